"""Streams that foreign readers have saved."""

from .data_line import Line
from .failure import Failure, expect, expect_true
from .profiles import FRAMES


def split(data, variation):
    """A file of raw frames as frames; what is no whole frame is a failure."""
    expect("bytes over a whole number of frames", len(data) % variation.size, 0)
    return [data[at:at + variation.size] for at in range(0, len(data), variation.size)]


def expect_sequence(frames, rendered, variation):
    """The rendered sequence stands somewhere in the stream, whole, in order and unchanged."""
    images = [variation.image(frame) for frame in frames]
    begins = [at for at in range(len(images)) if images[at:at + FRAMES] == rendered]
    if len(begins) != 1:
        right = [i for i, image in enumerate(rendered) if image in images]
        raise Failure(
            f"the sequence as rendered stands {len(begins)} times in {len(images)} frames, wanted once; "
            f"of its {FRAMES} frames these are somewhere: {right}")
    if variation.data_line:
        lines = [Line(frame, variation) for frame in frames[begins[0]:begins[0] + FRAMES]]
        expect("positions in the data lines", [line.index for line in lines], list(range(FRAMES)))
        expect("ids follow each other", [line.id - lines[0].id for line in lines], list(range(FRAMES)))
        expect("exposures", {line.exposure_ns for line in lines}, {4_000_000})


def expect_free_run(frames, variation, count):
    """Frames of the free-running camera: in order, no frame twice, none with a place in a sequence."""
    expect_true(f"{len(frames)} frames, wanted at least {count}", len(frames) >= count)
    # The first frame of a new reader is an old one: the module keeps its write position between
    # streams.
    lines = [Line(frame, variation) for frame in frames[1:]]
    ids = [line.id for line in lines]
    expect("ids in order and never twice", ids, sorted(set(ids)))
    expect("positions in the data lines", {line.index for line in lines}, {None})
