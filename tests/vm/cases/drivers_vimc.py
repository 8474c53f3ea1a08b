"""libcamera streams frames from vimc's sensor through its own pipeline."""
TIMEOUT_S = 120
SMOKE = False

from vm.basics import Skip, check, note, sh
from vm.drivers import load


def run():
    if "vimc.ko" not in sh("modprobe", "--show-depends", "vimc", may_fail=True):
        raise Skip("the image has no vimc; run with --full")
    load("vimc")
    cameras = sh("cam", "-l")
    check("Sensor B" in cameras, f"libcamera does not see vimc's camera: {cameras}")
    text = sh("cam", "-c1", "-C10", within_s=60)
    frames = [line for line in text.splitlines() if "bytesused" in line]
    note(f"{len(frames)} frames, the last: {frames[-1] if frames else text}")
    check(len(frames) == 10, f"10 frames were wanted and {len(frames)} came: {text}")
