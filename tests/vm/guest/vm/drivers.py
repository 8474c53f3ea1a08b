"""Kernel drivers of cameras that need no camera."""

import glob
import os
import re

from vm.basics import check, sh, until, write


def load(module, **parameters):
    """Loads a module and waits until udev is done with its devices."""
    sh("modprobe", module, *(f"{name}={value}" for name, value in parameters.items()))
    settle()


def unload(module):
    sh("modprobe", "-r", module)
    settle()


def settle():
    sh("udevadm", "settle", "--timeout=30")


def v4l2(device, *options, within_s=60, may_fail=False):
    """v4l2-ctl on a device; returns what it printed."""
    return sh("v4l2-ctl", "-d", device, *options, within_s=within_s, may_fail=may_fail)


def control(device, **values):
    """Sets controls by name, such as percentage_of_dropped_buffers=30."""
    v4l2(device, "-c", ",".join(f"{name}={value}" for name, value in values.items()))


def vivid_camera():
    """A camera of vivid that makes its own test pictures. Returns its device."""
    load("vivid", n_devs=1, node_types="0x1", num_inputs=1, input_types="0x0")
    return node_of("vivid", "capture")


def vivid_loop():
    """A camera of vivid that shows what is written into its output. Returns (camera, output)."""
    load("vivid", n_devs=1, node_types="0x101", num_inputs=1, input_types="0x3", num_outputs=1, output_types="0x1")
    camera, output = node_of("vivid", "capture"), node_of("vivid", "output")
    connect_vivid_loop(camera, output)
    return camera, output


def connect_vivid_loop(camera, output):
    """640x480 on both ends, and the one led to the other."""
    for device in (output, camera):
        v4l2(device, "--set-dv-bt-timings", "index=0")
    control(camera, loop_video=1, osd_text_mode=2)  # 2: nothing is written into the picture


def unbind_vivid():
    """The camera is gone, as if it had been pulled out."""
    write("/sys/bus/platform/drivers/vivid/unbind", "vivid.0")


def bind_vivid():
    write("/sys/bus/platform/drivers/vivid/bind", "vivid.0")
    settle()


def loopback():
    """A v4l2loopback device: what is written into it is what a reader gets."""
    # Two buffers, its default, are written while they are being read.
    load("v4l2loopback", devices=1, exclusive_caps=0, max_buffers=8)
    return node_of("v4l2 loopback", "any")


def devices():
    """The video devices there are: {"/dev/video0": driver name}."""
    found = {}
    for path in sorted(glob.glob("/dev/video*")):
        match = re.search(r"Driver name\s*: (.*)", sh("v4l2-ctl", "-d", path, "-D", may_fail=True))
        found[path] = match.group(1).strip() if match else ""
    return found


def node_of(driver, kind):
    """The device of a driver that captures, or puts out. Waits until it is there."""
    def find():
        for path in sorted(glob.glob("/dev/video*")):
            text = sh("v4l2-ctl", "-d", path, "-D", may_fail=True)
            capabilities = text.partition("Device Caps")[2]
            captures = "Video Capture" in capabilities
            if f": {driver}\n" in text and (kind == "any" or captures == (kind == "capture")):
                return path
        return None

    return until(find, 10, f"a {kind} device of {driver}")


def capture(device, frames, to=None, within_s=60):
    """Streams frames with v4l2-ctl; returns what it printed. Data goes to a file if wanted."""
    options = [f"--stream-to={to}"] if to else []
    return v4l2(device, "--stream-mmap=4", "--stream-poll", f"--stream-count={frames}", *options, within_s=within_s)


def set_format(device, fourcc, width=640, height=480):
    """Asks for a format and checks that the driver agreed."""
    v4l2(device, f"--set-fmt-video=width={width},height={height},pixelformat={fourcc}")
    text = v4l2(device, "--get-fmt-video")
    check(f"'{fourcc}'" in text and f"{width}/{height}" in text, f"{device} would not do {fourcc} {width}x{height}: {text}")


def is_there(device):
    return os.path.exists(device)
