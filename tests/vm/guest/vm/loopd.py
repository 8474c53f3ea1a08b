"""The daemon as a user has it: installed from its package, run by systemd."""

import glob
import os
import re

from vm.basics import check, note, read, sh, until, write

PACKAGES = sorted(glob.glob("/share/packages/*.deb"))
NAMES = [os.path.basename(package).partition("_")[0] for package in PACKAGES]
NAME = "vm"  # of the instance: loopd@vm, /etc/loopd/vm.toml; the runner takes it away after the case
BACK_WITHIN_S = 5  # of a camera's return, under emulation

# Thin enough for a CPU that is emulated: 640x480 is halved, a frame costs what a tenth does by default.
SETTINGS = {
    "camera.source": "v4l2",
    "camera.path": "/dev/video0",
    "events.stats_interval_s": 0.5,
    "features.points": 300,
    "features.lines": 60,
    "features.max_pixels": 80000,
    "loop.waiting_frames": 8,
    "loop.waiting_s": 0,
    "verify.min_inliers": 20,
}


def install():
    """Installs the packages unless they are installed."""
    if "install ok installed" not in sh("dpkg-query", "-W", "-f", "${Status}", "loopd", may_fail=True):
        sh("dpkg", "-i", *PACKAGES, within_s=120)
        note(f"installed: {NAMES}")


def purge():
    sh("dpkg", "--purge", *NAMES, within_s=120)


def configure(settings=None, name=NAME):
    """Writes the instance's config: SETTINGS with `settings` ("section.key": value) over them."""
    sections = {}
    for key, value in (SETTINGS | (settings or {})).items():
        section, _, word = key.partition(".")
        sections.setdefault(section, []).append(f"{word} = {toml(value)}")
    text = "".join(f"[{section}]\n" + "\n".join(lines) + "\n\n" for section, lines in sections.items())
    write(f"/etc/loopd/{name}.toml", text)


def toml(value):
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else str(value)


def start(settings=None, name=NAME):
    """Installs, configures and starts the instance; returns when it is ready."""
    install()
    configure(settings, name)
    sh("systemctl", "start", f"loopd@{name}", within_s=60)
    note(f"loopd@{name} is ready, process {main_pid(name)}")


def drop_in(text, name=NAME):
    """Adds to the unit, for this case only."""
    folder = f"/run/systemd/system/loopd@{name}.service.d"
    os.makedirs(folder, exist_ok=True)
    write(f"{folder}/vm-case.conf", text)
    sh("systemctl", "daemon-reload")


def stop(name=NAME):
    sh("systemctl", "stop", f"loopd@{name}.service", f"loopd@{name}.socket", within_s=60)


def show(what, name=NAME):
    """A property of the service as systemd tells it."""
    return sh("systemctl", "show", "--value", "-p", what, f"loopd@{name}").strip()


def main_pid(name=NAME):
    return int(show("MainPID", name))


def restarted(before, name=NAME, within_s=60):
    """Waits for another main process that is ready. Returns its number."""
    def look():
        pid = main_pid(name)
        return pid if pid not in (0, before) and show("ActiveState", name) == "active" else None

    pid = until(look, within_s, f"loopd@{name} to be restarted")
    note(f"process {before} was followed by {pid}")
    return pid


def socket_path(name=NAME):
    return f"/run/loopd/{name}/events.sock"


def loopctl(*words, name=NAME, within_s=30, may_fail=False):
    return sh("loopctl", *words, "--camera", name, within_s=within_s, may_fail=may_fail)


def tasks(pid):
    """Every thread of a process: {"name number": (CPUs it may run on, policy, real-time priority)}."""
    found = {}
    for task in os.listdir(f"/proc/{pid}/task"):
        number, name = int(task), read(f"/proc/{pid}/task/{task}/comm").strip()
        found[f"{name} {task}"] = (os.sched_getaffinity(number), os.sched_getscheduler(number),
                                   os.sched_getparam(number).sched_priority)
    return found


class Footprint:
    """Descriptors, threads and memory of a process.

    `rss_kib` counts small pages only: where the kernel gives huge pages to all (Debian's default), it
    puts them under memory that is hardly used, minutes after it was, and that is no growth of ours.
    """

    def __init__(self, pid):
        self.pid = pid
        self.descriptors = len(os.listdir(f"/proc/{pid}/fd"))
        status = read(f"/proc/{pid}/status")
        self.threads = int(re.search(r"^Threads:\s*(\d+)", status, re.M).group(1))
        memory = read(f"/proc/{pid}/smaps_rollup")
        self.huge_kib = int(re.search(r"^AnonHugePages:\s*(\d+)", memory, re.M).group(1))
        self.rss_kib = int(re.search(r"^VmRSS:\s*(\d+)", status, re.M).group(1)) - self.huge_kib

    def __str__(self):
        return (f"{self.descriptors} descriptors, {self.threads} threads, "
                f"{self.rss_kib} KiB in small pages, {self.huge_kib} KiB in huge ones")


def check_no_growth(before, after, rss_kib):
    """The same process, no more descriptors and threads, at most `rss_kib` more memory."""
    note(f"before: {before}; after: {after}")
    check(before.pid == after.pid, f"process {before.pid} has become {after.pid}")
    check(after.descriptors <= before.descriptors, f"descriptors were lost: {before}; then {after}")
    check(after.threads <= before.threads, f"threads were left over: {before}; then {after}")
    check(after.rss_kib <= before.rss_kib + rss_kib, f"memory grew by more than {rss_kib} KiB: {before}; then {after}")
