"""v4l2loopback hands on what is fed into it, GREY and YUYV byte for byte, none lost or out of order."""
TIMEOUT_S = 120
SMOKE = False

from vm.basics import SEQUENCE, check
from vm.drivers import capture, loopback
from vm.programs import Feeder

SIZES = {"GREY": 307200, "YUYV": 614400}


def luma_of(number):
    with open(f"{SEQUENCE}/640x480/pgm/{number:06}.pgm", "rb") as file:
        return file.read()[-640 * 480:]


def check_order(frames, luma_step):
    """Every frame is one that was fed, and the one after the frame before."""
    numbers = {luma_of(number): number for number in range(48)}
    order = [numbers.get(frame[::luma_step]) for frame in frames]
    check(None not in order, f"frames are not those that were fed: {order}")
    steps = {(after - before) % 48 for before, after in zip(order, order[1:])}
    check(steps == {1}, f"frames are missing or out of order: {order}")


def run():
    device = loopback()  # it overwrites what a reader is slow to take: a slow feeder leaves emulation time
    for fourcc, size in SIZES.items():
        with Feeder(device, fps=3, laps=100, fourcc=fourcc) as feeder:
            feeder.shown()
            capture(device, 30, to="/tmp/frames")
        with open("/tmp/frames", "rb") as file:
            frames = [file.read(size) for _ in range(30)]
        check_order(frames, size // SIZES["GREY"])
