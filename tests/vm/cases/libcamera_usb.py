"""libcamera's UVC pipeline inside the shipped sandbox: frames, unplug noticed, replug taken up."""
TIMEOUT_S = 300
OWN_BOOT = True
SMOKE = False

import os
import time

from vm import loopd
from vm.basics import note, sh, write
from vm.drivers import load
from vm.events import Events
from vm.programs import UsbCamera

PLAIN_SYSFS = "/run/vm-sysfs"  # what is written below the overlay would stay in it
HOST = "/sys/devices/platform/vhci_hcd.0"


def give_firmware_path():
    """libcamera names USB cameras by the firmware's path of their host, which vhci-hcd has none of."""
    load("overlay")
    os.makedirs("/run/vm-overlay/upper/firmware_node", exist_ok=True)
    os.makedirs("/run/vm-overlay/work", exist_ok=True)
    write("/run/vm-overlay/upper/firmware_node/path", "\\_SB_.PCI0.XHC0\n")
    sh("mount", "-t", "overlay", "overlay", "-o",
       f"lowerdir={HOST},upperdir=/run/vm-overlay/upper,workdir=/run/vm-overlay/work", HOST)


def run():
    load("vhci-hcd")
    loopd.install()
    os.makedirs(PLAIN_SYSFS)
    sh("mount", "-t", "sysfs", "sysfs", PLAIN_SYSFS)
    with UsbCamera(fps=10, sysfs=PLAIN_SYSFS) as usb:
        usb.plug()
        give_firmware_path()
        loopd.drop_in("[Service]\nEnvironment=SYSTEMD_DEVICE_VERIFY_SYSFS=0\n")
        loopd.start({"camera.source": "libcamera", "camera.path": "", "camera.width": 640, "camera.height": 480})
        with Events() as events:
            events.frames(3, within_s=90)
            start = time.monotonic()
            usb.tell("unplug")
            events.state("camera_lost", within_s=5)
            note(f"the loss was noticed after {time.monotonic() - start:.1f} s")
            usb.plug()
            events.state("camera_back", within_s=15)
            events.frames(2)
