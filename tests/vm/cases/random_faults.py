"""Random faults of vivid for 5 minutes, or LOOPD_VM_MINUTES=60: no crash, hang or growth beyond the map."""
TIMEOUT_S = 4500
SMOKE = False

import os
import random
import time

from vm import loopd
from vm.basics import check, note
from vm.drivers import bind_vivid, control, unbind_vivid, vivid_camera
from vm.events import Events

FAULTS = ("inject_v4l2_buf_flag_error", "inject_fatal_streaming_error", "inject_vidioc_reqbufs_error",
          "inject_vidioc_streamon_error", "inject_vidioc_qbuf_error", "disconnect")
# By then each way to fail has been met, several times, and the memory is there that these need.
SETTLING = 0.2  # of the time
SETTLING_FAULTS = 100


def strike(choice, camera):
    fault = choice.choice(FAULTS + ("unbind", "dropped"))
    if fault == "dropped":
        control(camera, percentage_of_dropped_buffers=choice.choice((0, 20, 80)))
    elif fault != "unbind":
        control(camera, **{fault: 1})
    if fault in ("unbind", "disconnect"):
        unbind_vivid()
        bind_vivid()
    return fault


def run():
    minutes = float(os.environ.get("LOOPD_VM_MINUTES", "5"))
    vivid_camera()
    choice, count = random.Random(1), 0
    camera = "/dev/v4l/by-path/platform-vivid.0-video-index0"  # whichever number the node gets
    loopd.start({"camera.path": camera})
    with Events() as events:
        events.frames(3)
        begun = minute = time.monotonic()
        end, before = begun + minutes * 60, None
        while time.monotonic() < end:
            fault = strike(choice, camera)
            try:
                events.frames(1, within_s=30)
            except AssertionError as failure:
                raise AssertionError(f"no frame after fault {count}, {fault}: {failure}") from failure
            count += 1
            if time.monotonic() >= minute + 60:
                minute += 60
                note(f"{count} faults: {loopd.Footprint(loopd.main_pid())}")
            if before is None and time.monotonic() >= begun + minutes * 60 * SETTLING and count >= SETTLING_FAULTS:
                before = loopd.Footprint(loopd.main_pid())
                map_before = events.next("stats", 10)["bytes"]
        note(f"{count} faults")
        check(before, f"only {count} faults in {minutes} minutes")
        of_map = (events.next("stats", 10)["bytes"] - map_before) // 1024  # it grows with what is seen
        note(f"the map grew by {of_map} KiB")
        loopd.check_no_growth(before, loopd.Footprint(loopd.main_pid()), rss_kib=4096 + of_map)
        check(events.next("stats", 10)["epoch"] == events.epoch, "the epoch should be the same")
