"""v4l2loopback hands on what is fed into it, GREY and YUYV byte for byte, none lost or out of order."""
TIMEOUT_S = 120
SMOKE = False

import os
import time

from vm.basics import SEQUENCE, check
from vm.drivers import loopback
from vm.programs import Feeder, Program

SIZES = {"GREY": 307200, "YUYV": 614400}
FRAMES = "/tmp/frames"
COUNT = 30


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


def taken(size):
    """Frames that the reader has written to its file; the newest may lack what it still holds back."""
    return (os.path.getsize(FRAMES) + 4096) // size if os.path.exists(FRAMES) else 0


def hand_over(feeder, device, size):
    """Feeds the next image when the reader has taken the one before: the driver overwrites, whoever is slow."""
    reader = Program("v4l2-ctl", "-d", device, "--stream-mmap=4", "--stream-poll", f"--stream-count={COUNT}",
                     f"--stream-to={FRAMES}")
    with reader:
        while reader.process.poll() is None:
            before = taken(size)
            feeder.step()
            deadline = time.monotonic() + 2  # the reader may not stream yet
            while taken(size) == before and reader.process.poll() is None and time.monotonic() < deadline:
                time.sleep(0.01)


def run():
    device = loopback()
    for fourcc, size in SIZES.items():
        if os.path.exists(FRAMES):
            os.remove(FRAMES)
        with Feeder(device, laps=100, fourcc=fourcc) as feeder:
            feeder.step()
            hand_over(feeder, device, size)
        with open(FRAMES, "rb") as file:
            frames = [file.read(size) for _ in range(COUNT)]
        check_order(frames, size // SIZES["GREY"])
