"""Installed from the package and enabled, it starts at boot without a camera and takes the one that comes."""
TIMEOUT_S = 180
SMOKE = True

from vm import loopd
from vm.basics import check, note, sh
from vm.drivers import devices, vivid_camera
from vm.events import Events


def run():
    loopd.install()
    loopd.configure()
    sh("systemctl", "enable", f"loopd@{loopd.NAME}")


def after_reboot():
    check(not devices(), f"there should be no camera yet: {devices()}")
    with Events() as events:
        check(loopd.show("ActiveState") == "active", "the service should run since boot")
        lost = events.state(("camera_lost", "starting"))
        note(f"without a camera: {lost}")
        pid = loopd.main_pid()
        vivid_camera()
        events.state(("running", "camera_back"), within_s=30)
        events.frames(5)
        check(loopd.main_pid() == pid, "the process should be the one of the boot")
    note(loopd.loopctl("status"))
    sh("systemctl", "disable", f"loopd@{loopd.NAME}")
