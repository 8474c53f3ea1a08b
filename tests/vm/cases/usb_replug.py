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

WARM_UP = 10  # the allocator comes to rest
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
            for _ in range(WARM_UP):
                replug(usb, events)
            before = loopd.Footprint(loopd.main_pid())
            seconds = []
            for done in range(TIMES):
                seconds.append(replug(usb, events))
                if done % 20 == 19:
                    stats = events.next("stats", 10)
                    note(f"{done + 1} times: {loopd.Footprint(loopd.main_pid())}; map {stats['images']} images, {stats['bytes']} bytes")
            check(events.next("stats", 10)["epoch"] == events.epoch, "the epoch should be the same")
            loopd.check_no_growth(before, loopd.Footprint(loopd.main_pid()), rss_kib=4096)
    note(f"back after {min(seconds):.2f} to {max(seconds):.2f} s")
