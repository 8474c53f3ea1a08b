"""Programs, time limits and what a case says when it does not hold."""

import subprocess
import time

PROGRAMS = "/share/programs"
SEQUENCE = "/share/sequence"  # two laps: pgm/NNNNNN.pgm and jpeg/NNNNNN.jpg, 640x480


class Failure(AssertionError):
    """The case does not hold; the message says what was expected and what was seen."""


class Skip(Exception):
    """The case cannot be tried on this machine; the message says why."""


def check(condition, message):
    if not condition:
        raise Failure(message)


def note(message):
    """A line for the case's log, with the time since boot."""
    print(f"[{time.monotonic():9.3f}] {message}", flush=True)


def sh(*words, within_s=60, may_fail=False):
    """Runs a program and returns what it printed. A failing one fails the case, unless it may."""
    try:
        done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
                              text=True, errors="replace", timeout=within_s)
    except subprocess.TimeoutExpired as late:
        raise Failure(f"{' '.join(words)} was not done within {within_s} s; so far: {late.stdout}") from late
    check(may_fail or done.returncode == 0, f"{' '.join(words)} failed with {done.returncode}: {done.stdout.strip()}")
    return done.stdout


def until(condition, within_s, what):
    """Waits for something that nobody announces, looking ten times a second. Returns its value."""
    deadline = time.monotonic() + within_s
    while True:
        value = condition()
        if value:
            return value
        check(time.monotonic() < deadline, f"{what}: not within {within_s} s")
        time.sleep(0.1)


def read(path):
    with open(path) as file:
        return file.read()


def write(path, text):
    with open(path, "w") as file:
        file.write(text)
