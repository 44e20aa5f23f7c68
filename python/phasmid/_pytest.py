"""Fixtures of pytest: an emulated scanner, or a station of several, for each test.

The mark ``phasmid`` selects what they are; a mark nearer to the test takes precedence::

    @pytest.mark.phasmid(profile="webcam-grey", scene="sphere", faults=[{"what": "dropped", "times": 1}])
    def test_driver(phasmid_device: phasmid.Device) -> None: ...

Its arguments are those of `phasmid.Device`, and

- ``link``: "memory" (``phasmid_device`` is a `phasmid.Device`), "pty" (a `phasmid.Serving`: pseudo-terminal and
  frame socket) or "usb" (a `phasmid.Serving` that is also a USB device, exported over USB/IP);
- ``station``: the name or path of the station of ``phasmid_station``, "two-pods" by default.

The clock of served devices is "fast" by default. The report of a test that fails shows the log of its devices;
``tmp_path`` has the recordings of those that are served, for ``phasmid replay`` and ``phasmid record info``, and
the last capture of one in memory.
"""

# Nothing is imported here that a run without the fixtures does not need.
from __future__ import annotations

import os
from collections.abc import Callable, Generator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterable

    from . import Device, Serving

#: Maximum length of the path of a run directory: names of Unix sockets end at 108 bytes.
_LONGEST = 80
#: Maximum time for the devices of a station to start or end, in seconds.
_PATIENCE_S = 300.0
#: What the report of a failed test shows of its devices: functions that return it.
_LOGS = pytest.StashKey[list[Callable[[], str]]]()


def pytest_configure(config: pytest.Config) -> None:
    """Register the mark."""
    what = "the devices of the fixtures phasmid_device and phasmid_station"
    config.addinivalue_line("markers", f"phasmid(profile, scene, seed, faults, link, station, ...): {what}")


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, Any, None]:
    """Add the logs to the report of a failed test, while its devices are there."""
    report = (yield).get_result()
    if report.failed and call.when == "call":
        for log in item.stash.get(_LOGS, []):
            try:
                text = log()
            except Exception as error:  # A report of a failed test must not fail.
                text = f"no log: {error}"
            report.sections.append(("phasmid", text))


@pytest.fixture
def phasmid_device(
    request: pytest.FixtureRequest, tmp_path: Path
) -> Generator[Device | Serving]:
    """Yield an emulated scanner: in memory, or served if the mark ``phasmid`` names another link."""
    from . import Device

    options = _options(request)
    options.pop("station", None)
    link = options.pop("link", "memory")
    if link not in ("memory", "pty", "usb"):
        raise pytest.UsageError(f'mark phasmid: link={link!r}; expected "memory", "pty" or "usb"')
    if link == "memory":
        with Device(**options) as device:
            _log(request, lambda: _memory_log(device, tmp_path))
            yield device
        return
    notices: list[str] = []
    options.setdefault("clock", "fast")
    served = Device(**options).serve(
        _run_dir(tmp_path, "device"),
        usb=link == "usb",
        record=tmp_path / "device.phasmid",
        notice=notices.append,
    )
    with served:
        _log(request, lambda: "\n".join([*notices, _served_log(served)]))
        yield served


@pytest.fixture
def phasmid_station(
    request: pytest.FixtureRequest, tmp_path: Path
) -> Generator[dict[str, Serving]]:
    """Yield the served devices of a station by their names. They share time and scene, in a process of their
    own."""
    import subprocess
    import sys
    import tempfile
    import time

    from . import _phasmid
    from ._device import Endpoints, Serving, schedule_of
    from ._documents import to_json

    options: dict[str, Any] = {"station": "two-pods", "clock": "fast", "faults": (), **_options(request)}
    command = [sys.executable, "-m", "phasmid", "serve", "--while-stdin", "--camera", "socket"]
    faults = tmp_path / "station.faults.toml"
    schedule = to_json(schedule_of(options.pop("faults")))
    faults.write_text(_phasmid.toml(schedule, "faults"), encoding="utf-8")
    command += ["--profile", os.fspath(options.pop("station")), "--faults", os.fspath(faults)]
    for name in ("scene", "seed", "clock", "samples", "time_samples"):
        if name in options:
            command += [f"--{name.replace('_', '-')}", str(options.pop(name))]
    if options:
        raise pytest.UsageError(f"mark phasmid: {', '.join(options)}; not an option of a station")
    log = tmp_path / "station.log"
    with tempfile.TemporaryDirectory(prefix="phasmid-") as private, log.open("wb") as out:
        run_dir = _run_dir(tmp_path, "station") or Path(private, "station")
        command += ["--run-dir", os.fspath(run_dir), "--record", os.fspath(tmp_path / "station.phasmid")]
        # Started elsewhere, because the working directory may have a module of the same name.
        process = subprocess.Popen(
            command, cwd=private, stdin=subprocess.PIPE, stdout=out, stderr=subprocess.STDOUT
        )
        try:
            end = time.monotonic() + _PATIENCE_S
            while "Ctrl-C ends it." not in log.read_text(errors="replace"):
                if process.poll() is not None or time.monotonic() > end:
                    pytest.fail(f"the station has not started:\n{log.read_text(errors='replace')}")
                time.sleep(0.01)
            described = sorted(run_dir.glob("*/device.json"))
            served = {
                path.parent.name: Serving(Endpoints._of(path.read_text(encoding="utf-8")), _nothing)
                for path in described
            }
            _log(request, lambda: log.read_text(errors="replace"))
            for one in served.values():
                _log(request, partial(_served_log, one))
            yield served
        finally:
            try:
                process.communicate(timeout=_PATIENCE_S)
            finally:
                process.kill()


def _options(request: pytest.FixtureRequest) -> dict[str, Any]:
    """Return the arguments of the marks."""
    options: dict[str, Any] = {}
    for mark in request.node.iter_markers("phasmid"):
        if mark.args:
            raise pytest.UsageError(f"mark phasmid: {mark.args!r}; expected arguments with names")
        options = {**mark.kwargs, **options}
    return options


def _run_dir(tmp_path: Path, name: str) -> Path | None:
    """Return the run directory; None for a private one if the path is too long for a socket."""
    path = tmp_path / name
    return path if len(os.fspath(path)) <= _LONGEST else None


def _log(request: pytest.FixtureRequest, log: Callable[[], str]) -> None:
    request.node.stash.setdefault(_LOGS, []).append(log)


def _nothing() -> None:
    """End nothing: the process of the station ends its devices."""


def _memory_log(device: Device, folder: Path) -> str:
    lines = [repr(device), f"time {device.time_s:.6f} s"]
    lines += [f"{way} {data!r}" for way, data in device.control.log]
    capture = device._last_capture() if device._last_capture is not None else None
    if capture is not None:
        path = folder / "capture.npz"
        capture.to_npz(path)
        lines.append(f"last capture: {path}")
    return "\n".join([*lines, *_faults(device.struck)])


def _served_log(served: Serving) -> str:
    lines = [repr(served), str(served.service.ask({"get": "device"})["device"])]
    return "\n".join([*lines, *_faults(served.service.struck)])


def _faults(struck: Iterable[object]) -> list[str]:
    return [f"fault: {fault}" for fault in struck]

