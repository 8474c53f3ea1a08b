"""What is fed into vivid's loop comes out of its camera, the luma byte for byte."""
TIMEOUT_S = 120
SMOKE = False

from vm.basics import SEQUENCE, check
from vm.drivers import capture, set_format, vivid_loop
from vm.programs import Feeder


def luma_of(name):
    with open(f"{SEQUENCE}/640x480/pgm/{name}", "rb") as file:
        return file.read()[-640 * 480:]


def frames_of(path, size):
    with open(path, "rb") as file:
        while frame := file.read(size):
            yield frame


def run():
    camera, output = vivid_loop()
    set_format(camera, "YUYV")
    with Feeder(output, fps=2) as feeder:
        feeder.shown()
        capture(camera, 60, to="/tmp/frames")
    shown = {luma_of(f"{number:06}.pgm"): number for number in range(48)}
    seen = [shown.get(frame[::2]) for frame in frames_of("/tmp/frames", 614400)]
    check(len(seen) == 60, f"60 frames were wanted and {len(seen)} came")
    check(None not in seen, f"{seen.count(None)} of 60 frames are none of the images fed: {seen}")
    check(seen == sorted(seen) and len(set(seen)) > 1, f"the images do not follow one another: {seen}")
