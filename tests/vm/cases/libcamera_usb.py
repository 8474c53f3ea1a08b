"""libcamera's UVC pipeline inside the shipped sandbox: frames, unplug noticed, replug taken up."""
TIMEOUT_S = 300
OWN_BOOT = True
SMOKE = False

import os
import time

from vm import loopd
from vm.basics import note, sh, until, write
from vm.drivers import load
from vm.events import Events
from vm.programs import UsbCamera, usb_links

HOST = "/sys/devices/platform/vhci_hcd.0"
PLAIN_SYSFS = "/run/vm-sysfs"  # what is written below the overlay would stay in it
PLAIN_HOST = HOST.replace("/sys", PLAIN_SYSFS)
OVERLAY = "/run/vm-overlay"


def mount_plain_sysfs():
    os.makedirs(PLAIN_SYSFS)
    sh("mount", "-t", "sysfs", "sysfs", PLAIN_SYSFS)
    sh("mount", "--make-private", PLAIN_SYSFS)


def cover():
    """libcamera names USB cameras by the firmware's path of their host, which vhci-hcd has none of."""
    sh("udevadm", "settle")
    sh("rm", "-rf", OVERLAY)
    os.makedirs(f"{OVERLAY}/upper/firmware_node")
    os.makedirs(f"{OVERLAY}/work")
    write(f"{OVERLAY}/upper/firmware_node/path", "\\_SB_.PCI0.XHC0\n")
    sh("mount", "-t", "overlay", "overlay", "-o",
       f"lowerdir={PLAIN_HOST},upperdir={OVERLAY}/upper,workdir={OVERLAY}/work", HOST)


def uncover():
    """An overlay that stays would hide what is plugged in anew."""
    sh("umount", "-l", HOST)


def run():
    load("vhci-hcd")
    load("overlay")
    loopd.install()
    mount_plain_sysfs()
    with UsbCamera(fps=10, sysfs=PLAIN_SYSFS) as usb:
        usb.plug()
        cover()
        loopd.drop_in("[Service]\nEnvironment=SYSTEMD_DEVICE_VERIFY_SYSFS=0\n")
        loopd.start({"camera.source": "libcamera", "camera.path": "", "camera.width": 640, "camera.height": 480})
        with Events() as events:
            events.frames(3, within_s=90)
            start = time.monotonic()
            usb.tell("unplug")
            events.state("camera_lost", within_s=5)
            note(f"the loss was noticed after {time.monotonic() - start:.1f} s")
            uncover()
            until(lambda: not usb_links(), 20, "the USB camera's links to go")
            usb.plug()
            cover()
            events.state("camera_back", within_s=15)
            events.frames(2)
