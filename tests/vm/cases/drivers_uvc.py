"""uvcvideo on the virtual USB camera: sizes, MJPG byte for byte, bad frames, freeze, unplug, replug."""
TIMEOUT_S = 180
SMOKE = False

from vm.basics import SEQUENCE, check, note
from vm.drivers import capture, is_there, load, set_format, v4l2
from vm.programs import UsbCamera


def bytes_of(path):
    with open(path, "rb") as file:
        return file.read()


def check_formats(device):
    text = v4l2(device, "--list-formats-ext")
    for word in ("'YUYV'", "'MJPG'", "640x480", "320x240", "30.000 fps", "15.000 fps"):
        check(word in text, f"{word} is not among the formats: {text}")


def check_jpeg(usb, device, size):
    usb.tell("show", 5)
    set_format(device, "MJPG", *(int(number) for number in size.split("x")))
    capture(device, 2, to="/tmp/frames")
    image = bytes_of(f"{SEQUENCE}/{size}/jpeg/000005.jpg")
    check(bytes_of("/tmp/frames") == 2 * image, f"two MJPG frames of {size} are not the two files")


def check_yuyv(usb, device):
    usb.tell("show", 7)
    set_format(device, "YUYV")
    capture(device, 2, to="/tmp/frames")
    luma = bytes_of(f"{SEQUENCE}/640x480/pgm/000007.pgm")[-640 * 480:]
    check(bytes_of("/tmp/frames")[:614400:2] == luma, "the luma of a YUYV frame is not that of the file")


def check_rate(usb, device):
    usb.tell("play", 1)
    set_format(device, "MJPG")
    before = usb.state()
    text = capture(device, 60)
    after = usb.state()
    note(f"60 frames: {after['sent'] - before['sent']} sent, {after['late'] - before['late']} late")
    check(after["sent"] - before["sent"] >= 60, "60 frames came and fewer were sent")


def check_truncated(usb, device):
    """A JPEG that ends early comes through: the reader must notice."""
    usb.tell("show", 5)
    usb.tell("truncated_frame")
    capture(device, 2, to="/tmp/frames")
    image = bytes_of(f"{SEQUENCE}/640x480/jpeg/000005.jpg")
    check(len(bytes_of("/tmp/frames")) == len(image) + len(image) // 3, "one of two frames should be cut short")


def run():
    load("vhci-hcd")
    with UsbCamera() as usb:
        device = usb.plug()
        check_formats(device)
        for size in ("640x480", "320x240"):
            check_jpeg(usb, device, size)
        check_yuyv(usb, device)
        check_rate(usb, device)
        check_truncated(usb, device)
        usb.unplug()
        check(not is_there(device), f"{device} is still there without the camera")
        device = usb.plug(serial="SN0002", sizes="320x240")
        check_jpeg(usb, device, "320x240")
