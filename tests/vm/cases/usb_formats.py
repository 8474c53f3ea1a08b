"""MJPG and YUYV of a USB camera reach the detector; two laps shown by it give loops."""
TIMEOUT_S = 300
SMOKE = False

from vm import loopd
from vm.basics import check, note
from vm.drivers import load, v4l2
from vm.events import Events
from vm.programs import UsbCamera


def check_format(device, fourcc, width, height):
    loopd.start({"camera.path": device, "camera.format": fourcc, "camera.width": width, "camera.height": height})
    with Events() as events:
        stats = events.frames(5)
        got = v4l2(device, "--get-fmt-video")
        check(f"'{fourcc}'" in got and f"{width}/{height}" in got, f"{fourcc} {width}x{height} was wished: {got}")
        check(stats["corrupt"] == 0, f"{stats['corrupt']} frames of {fourcc} were corrupt")
    loopd.stop()


def check_loops(usb, device):
    """Each image is shown until the detector has had it."""
    usb.tell("show", 0)
    loopd.start({"camera.path": device, "camera.format": "MJPG", "camera.width": 320, "camera.height": 240})
    with Events() as events:
        for image in range(40):
            usb.tell("show", image)
            events.frames(2)
        loops = events.loops()
    note(f"{len(loops)} loops")
    check(len(loops) >= 3, f"at least 3 loops of the second lap with the first were expected, not {len(loops)}")


def run():
    load("vhci-hcd")
    with UsbCamera(fps=15) as usb:
        device = usb.plug()
        for fourcc in ("YUYV", "MJPG"):
            for width, height in ((640, 480), (320, 240)):
                check_format(device, fourcc, width, height)
        check_loops(usb, device)
