"""Decodes our frames with numpy, and holds our decoder's coordinates against the result.

    cargo test --release --test studies -- --ignored writes_devices
    python tests/numpy_decoder.py target/release/phasmid target/tmp/zoo

Needs Python 3.11 and `pip install numpy pillow`. For each folder with a profile.toml and a scene.toml it
lets `phasmid demo` scan the scene, decodes the frames by the sequence.toml beside them, and compares with
`phasmid decode`. Exits 0 when the RMS difference is at most 0.001 px. It shares no code with the crate.
"""

import collections
import pathlib
import subprocess
import sys
import tempfile
import tomllib

import numpy as np
from PIL import Image

# Maximum RMS difference in projector pixels, over the pixels on which both agree.
MOST_PX = 0.001
# Minimum fraction of our valid pixels on which numpy must agree within a quarter of a pixel.
SHARED = 0.999


def expect(what, good, found):
    if not good:
        sys.exit(f"{what}: {found}")
    print(f"ok  {what}: {found}")


def read(folder):
    """The projector's columns, and pattern and picture of each frame."""
    manifest = tomllib.loads((folder / "sequence.toml").read_text())
    picture = lambda frame: np.array(Image.open(folder / frame["file"]), dtype=np.float64)
    frames = [(frame["pattern"], picture(frame)) for frame in manifest["frame"]]
    return manifest["projector"]["width_px"], frames


def fringe_sets(frames):
    """Of each period, finest first: the coordinate modulo it, and its variance but for a factor."""
    sets = collections.defaultdict(list)
    for pattern, picture in frames:
        if pattern["kind"] == "fringe" and pattern["axis"] == "x":
            sets[pattern["period_px"]].append((pattern["phase_rad"], picture))
    found = []
    for period, steps in sorted(sets.items()):
        # I = A + C cos(phase) - S sin(phase) by least squares, with C = B cos(2 pi x / period).
        phases = np.array([phase for phase, _ in steps])
        design = np.column_stack([np.ones(len(steps)), np.cos(phases), -np.sin(phases)])
        stack = np.stack([picture for _, picture in steps])
        _, c, s = np.tensordot(np.linalg.pinv(design), stack, axes=1)
        position = np.arctan2(s, c) / (2 * np.pi) % 1 * period
        found.append((period, position, period**2 / (len(steps) * (c**2 + s**2))))
    return found


def nearest(position, period, to):
    return position + period * np.round((to - position) / period)


def gray_middle(frames):
    """The middle of the finest cell that a pixel's bits name; None without Gray code."""
    plain, inverse = {}, {}
    of_kind = {pattern["kind"]: picture for pattern, picture in frames}
    for pattern, picture in frames:
        if pattern["kind"] == "gray" and pattern["axis"] == "x":
            # Each bit is identified by the width of its cells; its inverse has the same width.
            width = pattern["cell_px"] * 2 ** pattern["bit"]
            (inverse if pattern.get("inverted") else plain)[width] = picture
    if not plain:
        return None
    number = bit = 0
    for width in sorted(plain, reverse=True):
        if width in inverse:
            threshold = (plain[width] + inverse[width]) / 2
        else:
            threshold = (of_kind["white"] + of_kind["black"]) / 2
        # Converts reflected to plain binary, starting with the most significant bit.
        bit = bit ^ (plain[width] > threshold)
        number = 2 * number + bit
    cell = min(plain)
    return (number + 0.5) * cell - 0.5


def decode(frames, columns):
    """Projector columns, by the code or else from the coarsest period to the finest."""
    sets = fringe_sets(frames)
    middle = gray_middle(frames)
    if middle is None:
        period, position, _ = sets[-1]
        # The coarsest period covers the projector; positions slightly left of column 0 wrap to its
        # right end.
        middle = np.where(position > (columns + period) / 2, position - period, position)
    near = middle
    for period, position, _ in reversed(sets):
        near = nearest(position, period, near)
    # Averages all periods' positions nearest to the finest one, weighted by the inverse of their
    # variances.
    weights = [1 / variance for _, _, variance in sets]
    positions = [nearest(position, period, near) for period, position, _ in sets]
    return sum(w * x for w, x in zip(weights, positions)) / sum(weights)


def main():
    phasmid, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    devices = sorted(profile.parent for profile in folder.glob("*/profile.toml"))
    expect("devices", len(devices) >= 3, [device.name for device in devices])
    for device in devices:
        with tempfile.TemporaryDirectory() as scratch:
            capture, ours = pathlib.Path(scratch) / "capture", pathlib.Path(scratch) / "ours"
            run = lambda *words: subprocess.run(
                [phasmid, *map(str, words)], check=True, stdout=subprocess.DEVNULL
            )
            seen = ("--profile", device / "profile.toml", "--scene", device / "scene.toml")
            run("demo", *seen, "--out", capture)
            run("decode", "--manifest", capture / "sequence.toml", "--held", "state", "--out", ours)
            found = np.load(ours / "projector_x.npy").astype(np.float64)
            columns, frames = read(capture)
            difference = decode(frames, columns) - found
        # If the difference exceeds a quarter of a pixel, numpy has chosen another period.
        valid = np.isfinite(found)
        shared = valid & (np.abs(difference) < 0.25)
        share = shared.sum() / valid.sum()
        expect(f"device {device.name}: shared pixels", share > SHARED, f"{share:.5f} of {valid.sum()}")
        rms = np.sqrt(np.mean(difference[shared] ** 2))
        expect(f"device {device.name}: RMS difference", rms <= MOST_PX, f"{rms:.6f} px")


main()
