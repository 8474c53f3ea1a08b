"""libcamera's vimc pipeline delivers frames to the detector, and its threads keep to their CPUs."""
TIMEOUT_S = 240
SMOKE = False

from vm import loopd
from vm.basics import Skip, check, note, sh
from vm.drivers import load
from vm.events import Events

CPUS = {f"threads.{thread}_cpus": [0] for thread in ("capture", "detect", "lines", "main")}


def run():
    if "vimc.ko" not in sh("modprobe", "--show-depends", "vimc", may_fail=True):
        raise Skip("the image has no vimc; run with --full")
    load("vimc")
    loopd.start({"camera.source": "libcamera", "camera.path": "", "camera.width": 640, "camera.height": 480} | CPUS)
    with Events() as events:
        stats = events.frames(5, within_s=90)
        note(f"{stats}")
        found = loopd.tasks(loopd.main_pid())
        note(f"tasks: {found}")
        wrong = {name: task for name, task in found.items() if task[0] != {0}}
        check(not wrong, f"tasks outside the configured CPUs (CPUs, policy, priority): {wrong}")
