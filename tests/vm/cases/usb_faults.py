"""A USB camera that freezes, sends bad and cut frames, or comes back as another one or in another size."""
TIMEOUT_S = 300
SMOKE = False

from vm import loopd
from vm.basics import check, note
from vm.drivers import load
from vm.events import Events
from vm.programs import UsbCamera


def freeze(usb, events):
    usb.tell("freeze")
    stalled = events.state(("camera_stalled", "camera_lost"))
    check(stalled.get("cause"), f"a camera that stands still tells no cause: {stalled}")
    usb.tell("thaw")
    events.state(("camera_back", "running"), within_s=15)
    events.frames(2)


def cut_frames(usb, events):
    """JPEGs that end early are counted, one by one, and cost nothing else."""
    before = events.next("stats", 10)["corrupt"]
    for _ in range(3):
        usb.tell("truncated_frame")
        before = events.next("stats", 20, lambda r: r["corrupt"] > before, "a corrupt frame to be counted")["corrupt"]
    events.frames(2)


def bad_frame(usb, events):
    """One the camera itself calls damaged: uvcvideo drops it, or hands it on with a flag."""
    usb.tell("bad_frame")
    events.frames(5)


def other_camera(usb, events, device):
    usb.unplug()
    events.state("camera_lost")
    again = usb.plug(serial="SN0009", sizes="320x240")
    check(again == device, f"the other camera should get the same node, not {again}")
    events.state("camera_back", within_s=loopd.BACK_WITHIN_S)
    events.frames(2)


def run():
    load("vhci-hcd")
    with UsbCamera(fps=10) as usb:
        device = usb.plug()
        loopd.start({"camera.path": device, "camera.format": "MJPG"})
        with Events() as events:
            events.frames(3)
            pid = loopd.main_pid()
            freeze(usb, events)
            cut_frames(usb, events)
            bad_frame(usb, events)
            loopd.sh("journalctl", "--sync")
            other_camera(usb, events, device)
            check(loopd.main_pid() == pid, "the process should be the same")
        note(loopd.sh("journalctl", "-u", f"loopd@{loopd.NAME}", "-n", "12", "-o", "cat", "--no-pager"))
