"""Reads what `loopctl record` has the daemon write (docs/recording.md)."""

import struct

from vm.basics import check

FILE_HEADER, FRAME_HEADER = 256, 64


def frames(path):
    """The frames of a recording: (sequence number, time_ns, width, height, luma)."""
    with open(path, "rb") as file:
        header = file.read(FILE_HEADER)
        check(header[:8] == b"LOOPDREC", f"{path} is no recording")
        while len(head := file.read(FRAME_HEADER)) == FRAME_HEADER:
            check(head[:8] == b"LOOPDFRM", f"{path}: a frame does not begin where it should")
            sequence, time_ns, width, height = struct.unpack_from("<QqII", head, 16)
            luma = file.read(width * height)
            if len(luma) < width * height:
                return
            file.read(-(width * height) % 64)
            yield sequence, time_ns, width, height, luma
