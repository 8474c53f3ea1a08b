"""A daemon that hangs is restarted by the watchdog; clients get a new hello with a new epoch and go on."""
TIMEOUT_S = 180
SMOKE = True

import os
import signal

from vm import loopd
from vm.basics import check, note
from vm.drivers import vivid_camera
from vm.events import Events


def run():
    vivid_camera()
    loopd.start()
    with Events() as events:
        events.frames(3)
        pid = loopd.main_pid()
        os.kill(pid, signal.SIGSTOP)
        note("the daemon hangs")
        events.closed(within_s=60)
        loopd.restarted(pid)
        first_epoch, last = events.epoch, events.seen[-1]["seq"]
    with Events(since={"epoch": first_epoch, "seq": last}) as events:
        check(events.epoch != first_epoch, "a restart should have a new epoch")
        note(f"since: {events.watch['since']}")
        since = events.watch["since"]
        check(since["resumed"] or since.get("reason"), f"what was missed over the restart should be told: {since}")
        events.state(("running", "camera_back"), within_s=30)
        events.frames(3)
