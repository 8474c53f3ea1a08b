"""Streams faster than the detector: every frame is detected or counted as dropped; CPU per frame is told."""
TIMEOUT_S = 240
SMOKE = False

import time

from vm import loopd
from vm.basics import SEQUENCE, check, note, read
from vm.drivers import v4l2, vivid_camera
from vm.events import Events

SECONDS = 10


def cpu_seconds(pid):
    """Processor time of the threads of a process, by name."""
    import os
    used = {}
    for task in os.listdir(f"/proc/{pid}/task"):
        fields = read(f"/proc/{pid}/task/{task}/stat").rpartition(")")[2].split()
        name = read(f"/proc/{pid}/task/{task}/comm").strip()
        used[name] = used.get(name, 0.0) + (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return used


def measure(events, least_rate):
    """Frames a second that were taken or counted as dropped."""
    events.frames(1)
    pid = loopd.main_pid()
    first, before, start = events.next("stats", 10), cpu_seconds(pid), time.monotonic()
    last = events.next("stats", SECONDS + 20, lambda r: r["time_ns"] >= first["time_ns"] + SECONDS * 10**9)
    after = cpu_seconds(pid)
    seen = last["frames"] + last["dropped"] - first["frames"] - first["dropped"]
    rate = seen / ((last["time_ns"] - first["time_ns"]) / 1e9)
    spent = {name: f"{(after[name] - before.get(name, 0)) / max(seen, 1) * 1e6:.0f} us" for name in after}
    note(f"{rate:.1f} frames/s, {last['frames'] - first['frames']} of them detected; CPU a frame: {spent}")
    check(rate >= least_rate, f"{rate:.1f} frames a second were accounted for, at least {least_rate} were sent")


def run():
    camera = vivid_camera()
    v4l2(camera, "--set-fmt-video=width=320,height=180")
    v4l2(camera, "--set-parm=60", may_fail=True)
    loopd.start({"camera.path": camera, "camera.width": 320, "camera.height": 180, "camera.fps": 60})
    with Events() as events:
        measure(events, least_rate=45)
    loopd.stop()
    loopd.start({"camera.source": "file", "camera.path": f"{SEQUENCE}/320x240/pgm", "camera.fps": 1000,
                 "camera.loop": True})
    with Events() as events:
        measure(events, least_rate=100)
