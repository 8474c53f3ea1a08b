"""The driver is unbound and bound again under the daemon: named as lost, back in time, same map."""
TIMEOUT_S = 180
SMOKE = True

import time

from vm import loopd
from vm.basics import check, note
from vm.drivers import bind_vivid, unbind_vivid, vivid_camera
from vm.events import Events

TIMES = 3


def run():
    vivid_camera()
    loopd.start()
    with Events() as events:
        events.frames(5)
        before = loopd.Footprint(loopd.main_pid())
        for _ in range(TIMES):
            unbind_vivid()
            lost = events.state("camera_lost")
            check(lost.get("cause"), f"a loss tells its cause: {lost}")
            bind_vivid()
            start = time.monotonic()
            events.state("camera_back", within_s=loopd.BACK_WITHIN_S)
            note(f"back after {time.monotonic() - start:.1f} s")
            events.frames(2)
        stats = events.next("stats", 10)
        check(stats["epoch"] == events.epoch, "the epoch, and with it the map, should be the same")
        loopd.check_no_growth(before, loopd.Footprint(loopd.main_pid()), rss_kib=4096)
