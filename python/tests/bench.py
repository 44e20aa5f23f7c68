"""Figures of the Python package: time against Rust, time of a call, scenes for training, and memory.

    python python/tests/bench.py [PART ...]

Parts: rust, calls, scenes, memory, plugin; all by default. Run it with a Python that has the wheel, from the
repository. `rust` builds and runs `cargo bench --bench facade` in turns with `calls`, the same calls in Python.
"""

from __future__ import annotations

import os
import random
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import phasmid

ROOT = Path(__file__).resolve().parent.parent.parent


def minimum(work: Callable[[], object], times: int) -> float:
    """Return the least time in seconds that the work takes."""
    best = float("inf")
    for _ in range(times):
        begin = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - begin)
    return best


def calls() -> None:
    """Print minima as the program in Rust does."""
    device = phasmid.Device()
    capture = device.scan()
    scan = minimum(device.scan, 12)
    large = minimum(lambda: phasmid.decode(capture), 12)

    camera = {"width_px": 64, "height_px": 64}
    profile = phasmid.Profile({"extends": "webcam-grey", "name": "tiny", "camera": camera})
    small = phasmid.Device(profile, "plane").scan()
    frames, manifest, rig = small.frames, small.manifest, small.calibration
    toml = manifest.to_toml()
    decoder = phasmid.Decoder(manifest, 64, 64, rig)
    kept = minimum(lambda: decoder.decode(frames), 3000)
    by_manifest = minimum(lambda: phasmid.decode(frames, manifest, rig), 3000)
    by_text = minimum(lambda: phasmid.decode(frames, toml, rig), 3000)
    print(
        f"scan {scan * 1e3:.4f} ms, decode {large * 1e3:.4f} ms; 64 x 64 px: kept decoder "
        f"{kept * 1e3:.4f} ms, manifest {by_manifest * 1e3:.4f} ms, text {by_text * 1e3:.4f} ms"
    )


def rust() -> None:
    programs = {
        "rust": ["cargo", "bench", "-q", "--bench", "facade"],
        "python": [sys.executable, __file__, "calls"],
    }
    minima: dict[str, list[float]] = {}
    for turn in range(9):
        for name, program in programs.items():
            out = subprocess.run(program, cwd=ROOT, capture_output=True, text=True, check=True).stdout
            found = [float(number) for number in re.findall(r"([\d.]+) ms", out)]
            if turn:  # The first one builds.
                minima[name] = [min(pair) for pair in zip(found, minima.get(name, found))]
    ours, theirs = minima["python"], minima["rust"]
    for i, what in enumerate(("scan", "decode")):
        share = 100 * (ours[i] / theirs[i] - 1)
        print(f"{what}: {ours[i]:.2f} ms in Python, {theirs[i]:.2f} ms in Rust: {share:+.1f} %")
    both = [sum(times[:2]) for times in (ours, theirs)]
    print(f"both: {both[0]:.2f} ms, {both[1]:.2f} ms: {100 * (both[0] / both[1] - 1):+.1f} %")
    for i, what in enumerate(("kept decoder", "manifest", "text of a manifest"), 2):
        a, b = 1e3 * ours[i], 1e3 * theirs[i]
        print(f"64 x 64 px, {what}: {a:.0f} us in Python, {b:.0f} us in Rust: {a - b:.0f} us more")


def scenes() -> None:
    numbers = random.Random(1)
    begin = time.perf_counter()
    for seed in range(200):
        position = [numbers.uniform(-60, 60), numbers.uniform(-40, 40), numbers.uniform(700, 900)]
        scene = phasmid.Scene("sphere").with_(**{"object[0].position_mm": position})
        capture, truth = phasmid.render("webcam-grey", scene, seed=seed)
        assert capture.frames.shape[1:] == truth.depth_mm.shape == (480, 640)
    print(f"200 scenes of 640 x 480 pixels with truth: {time.perf_counter() - begin:.1f} s")


def memory() -> None:
    camera = {"width_px": 64, "height_px": 48}
    profile = phasmid.Profile({"extends": "webcam-grey", "name": "tiny", "camera": camera})

    def rss_mb() -> float:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1e6

    def use(devices: int, scans: int) -> None:
        for _ in range(devices):
            device = phasmid.Device(profile, "plane")
            for _ in range(scans):
                capture = device.scan()
            phasmid.compare(phasmid.decode(capture), device.truth(), device.rig)

    use(20, 10)
    before = rss_mb()
    use(1000, 10)
    print(f"1,000 devices and 10,000 scans: RSS {before:.1f} MB before, {rss_mb() - before:+.1f} MB")


def plugin() -> None:
    program = "import pytest, time; b = time.perf_counter(); import phasmid._pytest; print(time.perf_counter() - b)"
    times = []
    for _ in range(11):
        ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
        times.append(float(ran.stdout))
    print(f"import of the pytest plugin: {min(times) * 1e3:.1f} to {max(times) * 1e3:.1f} ms")


PARTS = {"rust": rust, "scenes": scenes, "memory": memory, "plugin": plugin}

if __name__ == "__main__":
    for part in sys.argv[1:] or PARTS:
        {**PARTS, "calls": calls}[part]()
