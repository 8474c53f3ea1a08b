"""kill -9, too much memory, reload, a control request: clients go on, the socket and its path stay."""
TIMEOUT_S = 300
SMOKE = False

import os
import signal

from vm import loopd
from vm.basics import check, note, sh, until
from vm.drivers import vivid_camera
from vm.events import Events


def inode():
    return os.stat(loopd.socket_path()).st_ino


def killed():
    """A client that connects while the daemon is away waits and is served."""
    with Events() as events:
        events.frames(2)
        pid, epoch, socket = loopd.main_pid(), events.epoch, inode()
        os.kill(pid, signal.SIGKILL)
        events.closed(within_s=20)
    with Events(within_s=60) as events:
        check(events.epoch != epoch, "a restart should have a new epoch")
        events.frames(2)
    loopd.restarted(pid)
    check(inode() == socket, "the socket should be the same after a restart")


def out_of_memory():
    """The kernel kills what grows over MemoryMax: the service comes back."""
    pid = loopd.main_pid()
    current = int(loopd.show("MemoryCurrent"))
    sh("systemctl", "set-property", "--runtime", f"loopd@{loopd.NAME}", f"MemoryMax={current // 4}")
    until(lambda: loopd.main_pid() != pid, 60, "the kernel to kill the daemon")
    note(f"result: {loopd.show('Result')}")
    sh("systemctl", "set-property", "--runtime", f"loopd@{loopd.NAME}", "MemoryMax=1G")
    loopd.restarted(pid)
    with Events(within_s=60) as events:
        events.frames(2)


def reload():
    """What can change does, with the same process and map."""
    pid = loopd.main_pid()
    with Events() as events:
        loopd.configure({"camera.format": "GREY", "events.stats_interval_s": 1})
        sh("systemctl", "reload", f"loopd@{loopd.NAME}")
        events.frames(2)
        until(lambda: "'GREY'" in sh("v4l2-ctl", "-d", "/dev/video0", "--get-fmt-video"), 20, "the new format")
        events.frames(2)
        check(loopd.main_pid() == pid, "a reload should keep the process")


def control():
    """pause and reset over the control socket, which is for owner and group only."""
    mode = os.stat(f"/run/loopd/{loopd.NAME}/control.sock").st_mode & 0o777
    check(mode & 0o007 == 0, f"others may use the control socket: {mode:o}")
    with Events() as events:
        loopd.loopctl("pause")
        loopd.loopctl("resume")
        events.frames(2)
        loopd.loopctl("reset")
        events.frames(2)


def activation():
    """A client starts the daemon by connecting."""
    loopd.stop()
    sh("systemctl", "start", f"loopd@{loopd.NAME}.socket")
    check(loopd.show("ActiveState") == "inactive", "the service should not run yet")
    with Events(within_s=60) as events:
        events.frames(2)


def run():
    vivid_camera()
    loopd.start()
    for part in (killed, out_of_memory, reload, control, activation):
        note(f"-- {part.__name__}")
        part()
