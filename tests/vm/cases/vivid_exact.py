"""The daemon's own recording of vivid's loop holds the luma that was fed in as YUYV, byte for byte."""
TIMEOUT_S = 240
SMOKE = False

from vm import loopd
from vm.basics import SEQUENCE, check, note
from vm.drivers import vivid_loop
from vm.events import Events
from vm.programs import Feeder
from vm.recording import frames


def images():
    """{luma: number} of the two laps."""
    found = {}
    for number in range(48):
        with open(f"{SEQUENCE}/640x480/pgm/{number:06}.pgm", "rb") as file:
            found[file.read()[-640 * 480:]] = number
    return found


def run():
    camera, output = vivid_loop()
    with Feeder(output, fps=2) as feeder:
        feeder.shown()
        loopd.start({"camera.path": camera, "camera.format": "YUYV"})
        with Events() as events:
            events.frames(1)
        loopd.loopctl("record", "/tmp/vivid.rec", "--seconds", "4", "--max-mib", "200", within_s=90)
    shown, seen = images(), []
    for _, time_ns, width, height, luma in frames("/tmp/vivid.rec"):
        check((width, height) == (640, 480), f"a frame is {width}x{height}")
        check(time_ns > 0, "a frame has no time")
        check(luma in shown, f"frame {len(seen)} is none of the images that were fed in")
        seen.append(shown[luma])
    note(f"{len(seen)} frames: {seen}")
    check(len(seen) >= 4 and seen == sorted(seen), f"frames of several images, in order, were expected: {seen}")
