"""Shared by the tests."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

import phasmid
import pytest

#: For a hang, not for speed.
DEADLINE_S = 300


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the totals as Rust's tests do, for `.ci/run`."""
    count = {key: len(terminalreporter.stats.get(key, [])) for key in ("passed", "failed", "error")}
    failed = count["failed"] + count["error"]
    word = "FAILED" if failed else "ok"
    terminalreporter.write_line(f"test result: {word}. {count['passed']} passed; {failed} failed; 0 ignored")


def wait_until(what: str, check: Callable[[], bool]) -> None:
    """Wait for something to happen."""
    end = time.monotonic() + DEADLINE_S
    while not check():
        assert time.monotonic() < end, f"{what} did not happen"
        time.sleep(0.01)


@contextlib.contextmanager
def started(*arguments: str, **options: object) -> Iterator[subprocess.Popen[str]]:
    """Start a program with SIGINT at its default, and kill it at the end."""
    process = subprocess.Popen(
        arguments,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        **options,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def command() -> str:
    """Return the path of the installed command."""
    return os.path.join(os.path.dirname(sys.executable), "phasmid")


#: The whole camera.
WEBCAM = phasmid.Profile("webcam-grey").to_dict()["camera"]


def small() -> phasmid.Profile:
    """Return a camera of 160 x 120 pixels: the middle of a webcam's image."""
    camera = {"width_px": 160, "height_px": 120, "sensor_width_mm": WEBCAM["sensor_width_mm"] / 4}
    return phasmid.Profile({"extends": "webcam-grey", "name": "small", "camera": camera})
