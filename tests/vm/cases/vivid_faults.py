"""Every fault that vivid can inject is survived, told and counted."""
TIMEOUT_S = 300
SMOKE = False

from vm import loopd
from vm.basics import check, note
from vm.drivers import bind_vivid, control, unbind_vivid, vivid_camera
from vm.events import Events

LOST = ("camera_lost", "camera_stalled")


def counted(events, name, before):
    """Waits until a counter of the stats has grown over `before`."""
    stats = events.next("stats", 20, lambda record: record[name] > before, f"{name} to grow over {before}")
    note(f"{name}: {before}, then {stats[name]}")


def flagged_frame(events, camera):
    before = events.next("stats", 10)["corrupt"]
    control(camera, inject_v4l2_buf_flag_error=1)
    counted(events, "corrupt", before)


def dropped_frames(events, camera):
    before = events.next("stats", 10)["dropped"]
    control(camera, percentage_of_dropped_buffers=60)
    counted(events, "dropped", before)
    control(camera, percentage_of_dropped_buffers=0)


def named_loss(events, camera, fault):
    """A fault that ends the stream: lost with a cause, then back."""
    control(camera, **{fault: 1})
    lost = events.state(LOST)
    check(lost.get("cause"), f"{fault} tells no cause: {lost}")
    events.state("camera_back", within_s=15)
    events.frames(2)


def refused_start(events, camera, fault):
    """A fault that strikes when the camera is opened again: the one after it succeeds."""
    control(camera, **{fault: 1})
    control(camera, inject_fatal_streaming_error=1)
    events.state(LOST)
    events.state("camera_back", within_s=15)
    events.frames(2)


def refused_buffer(events, camera):
    """A buffer that the driver does not take once is given to it again: the stream goes on."""
    control(camera, inject_vidioc_qbuf_error=1)
    events.frames(8)  # more than there are buffers


def disconnected(events, camera):
    """The device says that it is gone while its node stays, and udev is silent."""
    control(camera, disconnect=1)
    events.state(LOST)
    unbind_vivid()
    bind_vivid()
    events.state("camera_back", within_s=15)
    events.frames(2)


def run():
    camera = vivid_camera()
    loopd.start({"camera.path": camera})
    with Events() as events:
        events.frames(3)
        before = loopd.Footprint(loopd.main_pid())
        flagged_frame(events, camera)
        dropped_frames(events, camera)
        named_loss(events, camera, "inject_fatal_streaming_error")
        for fault in ("inject_vidioc_reqbufs_error", "inject_vidioc_streamon_error"):
            note(fault)
            refused_start(events, camera, fault)
        refused_buffer(events, camera)
        disconnected(events, camera)
        check(events.next("stats", 10)["epoch"] == events.epoch, "the epoch should be the same")
        loopd.check_no_growth(before, loopd.Footprint(loopd.main_pid()), rss_kib=4096)
