"""Two laps shown through vivid's loop: a socket client gets loops of the second lap with the first."""
TIMEOUT_S = 240
SMOKE = True

from vm import loopd
from vm.basics import check, note
from vm.drivers import vivid_loop
from vm.events import Events
from vm.programs import Feeder

LAP = 24  # images
IMAGES = 38


def shown_at(times, time_ns):
    """Number of the image that was shown at a time; times: [(time_ns, number)]."""
    numbers = [number for begin, number in times if begin <= time_ns]
    return numbers[-1] if numbers else None


def run():
    camera, output = vivid_loop()
    with Feeder(output) as feeder:
        times = [feeder.shown()]
        loopd.start({"camera.path": camera, "camera.format": "YUYV"})
        with Events() as events:
            events.state(("running", "camera_back"))
            for _ in range(IMAGES - 1):
                events.frames(2)  # one may have been taken before the image was there
                times.append(feeder.step())
            events.frames(2)
            loops = events.loops()
    pairs = [(shown_at(times, loop["query"]["time_ns"]), shown_at(times, loop["match"]["time_ns"])) for loop in loops]
    good = [pair for pair in pairs if None not in pair and abs(pair[0] - pair[1] - LAP) <= 2]
    note(f"{len(loops)} loops, {len(good)} of them a lap apart: {pairs}")
    check(len(good) >= 3, f"at least 3 loops with the first lap were expected: {pairs}")
