"""Runs the cases of /share/plan.json inside the machine, one after the other, and powers off.

Each case is a transient systemd service of its own, so that its time-out ends all it has started.
What it leaves behind is cleaned up, what the kernel said is read. Progress is kept in
/share/state.json: a machine that was rebooted, on purpose or by a crash, goes on where it was.

Lines for the host, on the console:  VM-CASE name passed|failed|skipped seconds reason
"""

import glob
import json
import os
import re
import subprocess
import time

SHARE = "/share"
PLAN = f"{SHARE}/plan.json"
STATE = f"{SHARE}/state.json"
SKIPPED = 77
MODULES = ("vivid", "v4l2loopback", "vimc", "uvcvideo", "vhci_hcd")
KERNEL_FAULT = re.compile(
    r"\bBUG:|\bOops\b|\bWARNING: |general protection fault|Kernel panic|blocked for more than"
    r"|unable to handle|refcount_t: |UBSAN:|KASAN:"
)


def command(*words, within_s=60):
    """Exit status and output of a program; a hung one counts as failed."""
    try:
        done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
                              text=True, errors="replace", timeout=within_s)
        return done.returncode, done.stdout
    except subprocess.TimeoutExpired:
        return 124, f"{' '.join(words)}: no answer within {within_s} s\n"


class Progress:
    """Which cases are done and which one is at work, on the host's disk."""

    def __init__(self):
        self.done = []
        self.current = None  # name of the case at work
        self.part = "run"  # the function of it that is called next
        self.expected_boot = False  # the runner itself asked for the reboot
        if os.path.exists(STATE):
            with open(STATE) as file:
                self.__dict__.update(json.load(file))

    def save(self):
        with open(STATE + ".new", "w") as file:
            json.dump(self.__dict__, file)
            file.flush()
            os.fsync(file.fileno())
        os.replace(STATE + ".new", STATE)


class Case:
    """One case of the plan and the folder of its results."""

    def __init__(self, plan, environment):
        self.environment = environment
        self.name = plan["name"]
        self.timeout_s = plan["timeout_s"]
        self.own_boot = plan["own_boot"]
        self.reboots = plan["reboots"]
        self.folder = f"{SHARE}/results/{self.name}"
        os.makedirs(self.folder, exist_ok=True)

    def call(self, part):
        """Runs one function of the case. Returns its exit status and whether time ran out."""
        unit = f"case-{self.name.replace('_', '-')}"
        start = time.monotonic()
        with open(f"{self.folder}/log", "a") as log:
            try:
                done = subprocess.run(
                    ["systemd-run", "--quiet", "--wait", "--pipe", "--collect", f"--unit={unit}",
                     f"--property=RuntimeMaxSec={self.timeout_s}", "--property=TimeoutStopSec=5",
                     "--setenv=PYTHONUNBUFFERED=1",
                     *(f"--setenv={name}={value}" for name, value in self.environment.items()),
                     "python3", "-B", f"{SHARE}/guest/run_case.py", self.name, part],
                    stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT, timeout=self.timeout_s + 30)
            except subprocess.TimeoutExpired:
                return 124, True
        return done.returncode, time.monotonic() - start >= self.timeout_s

    def reason(self):
        """The last line of the log that says something."""
        with open(f"{self.folder}/log", errors="replace") as log:
            lines = [line.strip() for line in log if line.strip()]
        return lines[-1][:200] if lines else "it said nothing"

    def add(self, name, text):
        with open(f"{self.folder}/{name}", "a") as file:
            file.write(text)


class KernelLog:
    """What the kernel says from now on."""

    def __init__(self):
        self.fd = os.open("/dev/kmsg", os.O_RDONLY | os.O_NONBLOCK)
        os.lseek(self.fd, 0, os.SEEK_END)

    def read(self):
        lines = []
        while True:
            try:
                record = os.read(self.fd, 8192).decode(errors="replace")
            except BlockingIOError:
                return lines
            except BrokenPipeError:  # records were overwritten before they were read
                lines.append("(lines are missing here)")
                continue
            head, _, text = record.partition(";")
            lines.append(f"[{int(head.split(',')[2]) / 1e6:10.3f}] {text.splitlines()[0]}")


def journal_cursor():
    _, text = command("journalctl", "-n0", "--show-cursor", "--quiet")
    return text.strip().rpartition("-- cursor: ")[2]


def clean_up():
    """Takes away what a case may have left. Returns whether the machine is as it was."""
    command("systemctl", "stop", "loopd@*", "--no-ask-password", within_s=30)
    command("systemctl", "reset-failed")
    for path in glob.glob("/run/systemd/system/loopd@*.d/vm-*.conf") + glob.glob("/etc/loopd/vm*.toml"):
        os.remove(path)
    command("systemctl", "daemon-reload")
    for module in MODULES:
        if os.path.exists(f"/sys/module/{module}"):
            status, text = command("modprobe", "-r", module, within_s=20)
            if status != 0:
                print(f"VM-NOTE {text.strip()}", flush=True)
                return False
    return True


def report(case, verdict, seconds, reason=""):
    with open(f"{case.folder}/verdict", "w") as file:
        file.write(f"{verdict} {seconds:.1f} {reason}\n")
    print(f"VM-CASE {case.name} {verdict} {seconds:.1f} {reason}", flush=True)


def verdict_of(case, status, late, faults):
    if status == SKIPPED:
        return "skipped", case.reason()
    if late:
        return "failed", f"not done within {case.timeout_s} s; so far: {case.reason()}"
    if status != 0:
        return "failed", case.reason()
    if faults:
        return "failed", f"the kernel said: {faults[0]}"
    return "passed", ""


def reboot(progress):
    progress.expected_boot = True
    progress.save()
    os.sync()
    command("systemctl", "reboot", "--no-block")


def finish(case, progress, verdict, seconds, reason):
    report(case, verdict, seconds, reason)
    progress.done.append(case.name)
    progress.current, progress.part = None, "run"
    progress.save()


def run_case(case, progress):
    """Runs a case, or the rest of it. Returns whether the machine must boot before the next."""
    progress.current = case.name
    progress.save()
    kernel, cursor, start = KernelLog(), journal_cursor(), time.monotonic()
    status, late = case.call(progress.part)
    seconds = time.monotonic() - start
    goes_on = case.reboots and progress.part == "run" and status == 0
    clean = goes_on or clean_up()
    said = kernel.read()
    case.add("kernel.log", "".join(line + "\n" for line in said))
    case.add("journal.log", command("journalctl", "-o", "short-monotonic", "--no-pager", f"--after-cursor={cursor}")[1])
    faults = [line for line in said if KERNEL_FAULT.search(line)]
    if goes_on and not faults:
        progress.part = "after_reboot"
        return True
    verdict, reason = verdict_of(case, status, late, faults)
    finish(case, progress, verdict, seconds, reason)
    return case.own_boot or bool(faults) or late or not clean


def main():
    with open(PLAN) as file:
        plan = json.load(file)
    cases = [Case(entry, plan["environment"]) for entry in plan["cases"]]
    progress = Progress()
    if progress.current and not progress.expected_boot:
        case = next(case for case in cases if case.name == progress.current)
        finish(case, progress, "failed", 0, "the machine went down in the middle of it; see console.log")
    progress.expected_boot = False
    with open("/proc/uptime") as file:
        print(f"VM-NOTE up after {file.read().split()[0]} s", flush=True)
    fresh = True
    for case in cases:
        if case.name in progress.done:
            continue
        if case.own_boot and not fresh and progress.part == "run":
            return reboot(progress)
        fresh = False
        if run_case(case, progress):
            return reboot(progress)
    print("VM-END", flush=True)
    command("systemctl", "poweroff", "--no-block")


main()
