"""The embedded data line, read as its documentation describes it; no code is shared with the crate."""

import struct
import zlib

from .failure import Failure

FIELDS = struct.Struct("<2sBBQIQII")


class Line:
    """Identity and time of a frame."""

    def __init__(self, frame, variation):
        step = variation.bytes_per_pixel
        # In YUYV, luma is the first byte of each pair. Y16 pixels are little-endian words.
        if variation.fourcc.startswith("Y1"):
            pixels = struct.unpack_from("<256H", frame)
        else:
            pixels = frame[0:256 * step:step]
        middle = (1 << variation.bits) // 2
        bits = "".join("1" if pixel > middle else "0" for pixel in pixels)
        raw = int(bits, 2).to_bytes(32, "big")
        magic, version, flags, self.id, index, self.start_ns, self.exposure_ns, crc = FIELDS.unpack(raw)
        if (magic, version, crc) != (b"\xa5\x5d", 1, zlib.crc32(raw[:28])):
            raise Failure(f"no data line in the first row: {raw.hex()}")
        self.index = index if flags & 1 else None
