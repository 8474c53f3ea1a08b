"""systemd-analyze is content, every task keeps to its CPUs and priority, and no network can be used."""
TIMEOUT_S = 240
SMOKE = False

import os
import re

from vm import loopd
from vm.basics import check, note, sh
from vm.drivers import bind_vivid, unbind_vivid, vivid_camera
from vm.events import Events

THREADS = {f"threads.{thread}_{what}": value
           for thread, cpu, priority in (("capture", 0, 20), ("detect", 1, 10), ("lines", 0, 5), ("main", 0, 15))
           for what, value in (("cpus", [cpu]), ("priority", priority))}
SOCKET_FAMILIES = {"AF_INET": 2, "AF_INET6": 10, "AF_NETLINK": 16, "AF_PACKET": 17, "AF_VSOCK": 40}


def security():
    unit = f"loopd@{loopd.NAME}.service"
    verify = sh("systemd-analyze", "verify", "--man=no", "/lib/systemd/system/loopd@.service", may_fail=True)
    check(not verify.strip(), f"systemd-analyze verify says: {verify}")
    text = sh("systemd-analyze", "security", "--no-pager", unit)
    level = float(re.search(r"exposure level for \S+: ([0-9.]+)", text).group(1))
    note(f"exposure level {level}")
    check(level <= 1.0, f"the exposure level is {level}: {text}")


def scheduling():
    """Each task has one CPU of its own and a real-time priority that the config names."""
    found = loopd.tasks(loopd.main_pid())
    note(f"tasks: {found}")
    wrong = {name: task for name, task in found.items()
             if len(task[0]) != 1 or task[1] != os.SCHED_FIFO or task[2] not in (5, 10, 15, 20)}
    check(not wrong, f"tasks outside the configured CPUs and priorities (CPUs, policy, priority): {wrong}")


def network():
    """The service's own sandbox, with another program in it, opens no socket but a Unix one."""
    text = "import socket\n"
    for name, number in SOCKET_FAMILIES.items():
        text += f"try:\n socket.socket({number}, socket.SOCK_DGRAM); print('{name} opened')\nexcept OSError: pass\n"
    properties = ("RestrictAddressFamilies", "PrivateNetwork", "SystemCallFilter", "SystemCallErrorNumber", "User")
    unit = sh("systemctl", "cat", f"loopd@{loopd.NAME}")
    options = [f"--property={line}" for line in unit.splitlines() if line.partition("=")[0] in properties]
    check(len(options) >= 4, f"the unit should restrict its sockets: {options}")
    opened = sh("systemd-run", "--quiet", "--wait", "--pipe", *options, "python3", "-c", text)
    check(not opened.strip(), f"sockets of other families than Unix can be had: {opened}")


def run():
    vivid_camera()
    loopd.start(THREADS)
    with Events() as events:
        events.frames(3)
        security()
        network()
        unbind_vivid()
        events.state("camera_lost")
        bind_vivid()
        events.state("camera_back", within_s=loopd.BACK_WITHIN_S)
        events.frames(2)
        scheduling()
