"""Frames that a foreign program has saved as a folder that `phasmid decode` takes."""

import struct
import zlib

from .data_line import Line
from .failure import expect
from .profiles import FRAMES, HEIGHT, WIDTH


def triggered(frames, variation):
    """Images of the one sequence that stands in a stream, told from the free-running camera's by
    their data lines: whole, in order, and nothing between them."""
    lines = [Line(frame, variation) for frame in frames]
    places = [at for at, line in enumerate(lines) if line.index is not None]
    expect("triggered frames", len(places), FRAMES)
    expect("their places in the stream", places, list(range(places[0], places[0] + FRAMES)))
    chosen = [lines[at] for at in places]
    expect("positions in the data lines", [line.index for line in chosen], list(range(FRAMES)))
    expect("ids follow each other", [line.id - chosen[0].id for line in chosen], list(range(FRAMES)))
    return [variation.image(frames[at]) for at in places]


def save(folder, images, manifest, calibration):
    """Writes pictures of 8 bits, a manifest that names them, and the calibration."""
    folder.mkdir()
    for index, image in enumerate(images):
        name = f"frame_{index:02}.png"
        (folder / name).write_bytes(png(image))
        # Replaces the next entry without a file. The added spaces mark the entry as done.
        manifest = manifest.replace("[[frame]]\n", f'[[ frame ]]\nfile = "{name}"\n', 1)
    (folder / "sequence.toml").write_text(manifest)
    (folder / "calibration.toml").write_text(calibration)


def png(pixels):
    """A grey picture of the camera's size."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    # Each PNG row begins with its filter type: 0, no filter.
    rows = b"".join(b"\0" + pixels[at:at + WIDTH] for at in range(0, WIDTH * HEIGHT, WIDTH))
    header = struct.pack(">IIBBBBB", WIDTH, HEIGHT, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
