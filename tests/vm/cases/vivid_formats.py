"""YUYV, GREY, NV12 and RGB3 of vivid reach the detector."""
TIMEOUT_S = 240
SMOKE = False

from vm import loopd
from vm.basics import check, note, sh
from vm.drivers import v4l2, vivid_camera
from vm.events import Events


def run():
    camera = vivid_camera()
    for fourcc in ("YUYV", "GREY", "NV12", "RGB3"):
        loopd.start({"camera.path": camera, "camera.format": fourcc})
        with Events() as events:
            stats = events.frames(5)
            got = v4l2(camera, "--get-fmt-video")
            check(f"'{fourcc}'" in got, f"{fourcc} was wished and the driver does {got}")
            check(stats["corrupt"] == 0, f"{stats['corrupt']} frames of {fourcc} were corrupt")
            note(f"{fourcc}: {stats['frames']} frames")
        loopd.stop()
    sh("systemctl", "reset-failed")
