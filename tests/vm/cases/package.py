"""Upgrade keeps the config and the running instance, doctor is content, purge leaves nothing behind."""
TIMEOUT_S = 300
OWN_BOOT = True
SMOKE = False

import os

from vm import loopd
from vm.basics import check, note, read, sh
from vm.drivers import vivid_camera
from vm.events import Events

TREES = ("/etc", "/usr", "/lib", "/var/lib", "/run")
OF_DPKG = ("/var/lib/dpkg", "/var/lib/systemd", "/run/systemd", "/run/udev", "/run/log", "/run/credentials",
           "/etc/ld.so.cache", "/etc/passwd", "/etc/group", "/etc/shadow", "/etc/gshadow", "/etc/subuid", "/etc/subgid")


def files():
    found = set()
    for tree in TREES:
        for folder, folders, names in os.walk(tree):
            folders[:] = [name for name in folders if not f"{folder}/{name}".startswith(OF_DPKG)]
            found.update(f"{folder}/{name}" for name in names + folders)
    return {path for path in found if not path.startswith(OF_DPKG) and "__pycache__" not in path}


def upgrade():
    """Installing again is what an upgrade does; a changed config file stays as it is."""
    mine = read("/etc/loopd/front.toml") + "\n# a line of the owner's\n"
    with open("/etc/loopd/front.toml", "w") as file:
        file.write(mine)
    pid = loopd.main_pid()
    sh("dpkg", "--force-confold", "-i", *loopd.PACKAGES, within_s=120)
    check(read("/etc/loopd/front.toml") == mine, "an upgrade should keep the config")
    loopd.restarted(pid)
    with Events(within_s=60) as events:
        events.frames(2)


def run():
    if os.path.exists("/usr/bin/loopd"):
        loopd.purge()
    before = files()
    vivid_camera()
    loopd.start()
    with Events() as events:
        events.frames(2)
    sh("systemctl", "enable", f"loopd@{loopd.NAME}")
    upgrade()
    note(sh("loopctl", "doctor", loopd.NAME, "--no-trial", may_fail=True))
    note(sh("loopctl", "cameras", within_s=60))
    loopd.purge()
    left = sorted(files() - before)
    check(not left, f"a purge left {left}")
    check("loopd" not in read("/etc/passwd"), "a purge left the user loopd")
    check("loopd" not in sh("ps", "-eo", "comm"), "a purge left a process")
