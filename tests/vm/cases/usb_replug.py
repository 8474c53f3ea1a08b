"""A USB camera is pulled out and plugged in 100 times: back in time, same process and map, no leak."""
TIMEOUT_S = 1500
SMOKE = False

import os
import time

from vm import loopd
from vm.basics import check, note
from vm.drivers import load
from vm.events import Events
from vm.programs import UsbCamera

TIMES = int(os.environ.get("LOOPD_VM_REPLUGS", "100"))


def replug(usb, events):
    """Returns the seconds from udev's word of the device to the daemon's."""
    usb.unplug()
    events.state("camera_lost")
    usb.plug()
    start = time.monotonic()
    events.state("camera_back", within_s=loopd.BACK_WITHIN_S)
    events.frames(1)
    return time.monotonic() - start


def run():
    load("vhci-hcd")
    with UsbCamera(fps=15) as usb:
        usb.tell("show", 0)  # one view: the map, and the memory for it, stays as it is
        device = usb.plug()
        loopd.start({"camera.path": device, "camera.format": "MJPG", "camera.width": 320, "camera.height": 240})
        with Events() as events:
            events.frames(3)
            replug(usb, events)
            before = loopd.Footprint(loopd.main_pid())
            seconds = [replug(usb, events) for _ in range(TIMES)]
            check(events.next("stats", 10)["epoch"] == events.epoch, "the epoch should be the same")
            loopd.check_no_growth(before, loopd.Footprint(loopd.main_pid()), rss_kib=8192)
    note(f"back after {min(seconds):.2f} to {max(seconds):.2f} s")
