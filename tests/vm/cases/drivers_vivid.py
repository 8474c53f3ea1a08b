"""vivid streams every format that loopd reads, and shows what is fed into its loop."""
TIMEOUT_S = 120
SMOKE = False

import os

from vm.basics import check, note
from vm.drivers import capture, bind_vivid, is_there, set_format, unbind_vivid, until, vivid_camera

BYTES_A_FRAME = {"YUYV": 614400, "GREY": 307200, "NV12": 460800, "RGB3": 921600}


def run():
    camera = vivid_camera()
    for fourcc, size in BYTES_A_FRAME.items():
        set_format(camera, fourcc)
        capture(camera, 10, to="/tmp/frames")
        got = os.path.getsize("/tmp/frames")
        note(f"{fourcc}: {got} bytes")
        check(got == 10 * size, f"10 frames of {fourcc} are {10 * size} bytes, not {got}")
    unbind_vivid()
    until(lambda: not is_there(camera), 5, f"{camera} to go when vivid is unbound")
    bind_vivid()
    until(lambda: is_there(camera), 5, f"{camera} to come back when vivid is bound")
