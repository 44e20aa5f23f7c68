"""As little of V4L2 as the tests need beside the foreign programs, in the words of the standard."""

import fcntl
import os
import pathlib
import struct

# Fields of an ioctl code: direction, size, type 'V', number.
READ, WRITE = 2, 1
QUERYCAP = READ << 30 | 104 << 16 | ord("V") << 8 | 0
S_FMT = (READ | WRITE) << 30 | 208 << 16 | ord("V") << 8 | 5
OUTPUT = 2
FIELD_NONE = 1


def names():
    """Name of each video node, by its path."""
    found = {}
    for node in pathlib.Path("/sys/class/video4linux").iterdir():
        if node.name.startswith("video"):
            found[f"/dev/{node.name}"] = (node / "name").read_text().strip()
    return found


def produce(path, width, height, fourcc, bytes_per_pixel=1):
    """Opens a node as a producer of frames with this format; returns the descriptor to write to."""
    node = os.open(path, os.O_RDWR)
    line = width * bytes_per_pixel
    pix = struct.pack(
        "<II4sIIIIIIIII", width, height, fourcc, FIELD_NONE, line, line * height, 8, 0, 0, 0, 0, 0)
    fcntl.ioctl(node, S_FMT, bytearray(struct.pack("<I4x", OUTPUT) + pix.ljust(200, b"\0")))
    return node
