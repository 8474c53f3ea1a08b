"""Programs of tests/vm/programs, started and ended by cases."""

import glob
import os
import select
import subprocess
import time

from vm.basics import PROGRAMS, SEQUENCE, check, note, until


class Program:
    """A program that runs beside the case and ends with the `with` block."""

    def __init__(self, *words):
        self.name = os.path.basename(words[0])
        self.process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0)
        self.printed = b""  # and not yet returned by line()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.end()

    def end(self):
        """Ends it, however it is doing. A second call does nothing."""
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(timeout=10)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()

    def line(self, within_s=20):
        """The next line it prints."""
        deadline = time.monotonic() + within_s
        while b"\n" not in self.printed:
            ready = select.select([self.process.stdout], [], [], max(0.0, deadline - time.monotonic()))[0]
            check(ready, f"{self.name} printed nothing within {within_s} s")
            more = os.read(self.process.stdout.fileno(), 65536)
            check(more, f"{self.name} ended")
            self.printed += more
        line, _, self.printed = self.printed.partition(b"\n")
        return line.decode().strip()


class Feeder(Program):
    """Shows the two laps on a V4L2 output, at a rate or (fps=0) image by image as told by step()."""

    def __init__(self, output, fps=0, laps=1, fourcc="YUYV", folder=f"{SEQUENCE}/640x480/pgm"):
        pace = ["--fps", str(fps)] if fps else ["--steps"]
        super().__init__(f"{PROGRAMS}/v4l2_feeder", folder, "--device", output, "--format", fourcc,
                         "--laps", str(laps), *pace)

    def shown(self):
        """The next image that was shown: (time_ns, number)."""
        time_ns, name = self.line().split()
        return int(time_ns), int(name.partition(".")[0])

    def step(self):
        """Shows the next image; returns (time_ns, number)."""
        self.process.stdin.write(b"\n")
        return self.shown()


class UsbCamera(Program):
    """A UVC camera on a USB port of vhci-hcd, which must be loaded. It does what it is told."""

    def __init__(self, fps=30, serial="SN0001", sizes="640x480,320x240", sysfs="/sys"):
        super().__init__(f"{PROGRAMS}/virtual_uvc_camera", SEQUENCE, "--fps", str(fps), "--serial", serial,
                         "--sizes", sizes, "--sysfs", sysfs)
        self.serial = serial

    def tell(self, *words):
        """Gives it a command; fails the case if it cannot do it."""
        check(self.ask(*words) == "ok", f"the USB camera would not {words}")

    def ask(self, *words):
        self.process.stdin.write((" ".join(str(word) for word in words) + "\n").encode())
        answer = self.line()
        if answer.startswith("state "):
            check(self.line() == "ok", "the USB camera's state ends with ok")
        return answer

    def state(self):
        """What it is doing: {"plugged": 1, "wanted": 0, "image": 3, "sent": 40, "late": 0}."""
        return {name: int(value) for name, value in (pair.split("=") for pair in self.ask("state").split()[1:])}

    def plug(self, serial=None, sizes=None):
        """Plugs it in; a port that is still being cleared is waited for. Returns its device."""
        if serial:
            self.serial = serial
            self.tell("serial", serial)
        if sizes:
            self.tell("sizes", sizes)
        until(lambda: self.ask("plug") == "ok", 10, "a free port of vhci-hcd")
        device = until(self.device, 20, "uvcvideo's device")
        note(f"plugged in: {device}")
        return device

    def device(self):
        """Its device; none if udev has not announced it."""
        return next((device for link, device in usb_links().items() if f"_{self.serial}-" in link), None)

    def unplug(self):
        """Pulls it out; returns when udev has taken its links away."""
        self.tell("unplug")
        note("unplugged")
        until(lambda: not usb_links(), 20, "the USB camera's links to go")


def usb_links():
    """Stable names of the USB cameras there are: {link: device}."""
    found = {}
    for link in glob.glob("/dev/v4l/by-id/*Virtual_Camera*-index0"):
        try:
            found[os.path.basename(link)] = os.path.realpath(link)
        except FileNotFoundError:  # it went between the two looks
            pass
    return found
