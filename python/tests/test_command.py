"""The command ``phasmid`` of the wheel."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import zlib
from pathlib import Path

import phasmid
import pytest
from phasmid import _phasmid
from conftest import DEADLINE_S, command, started, wait_until


def run(*arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(arguments, text=True, capture_output=True, timeout=DEADLINE_S, cwd=cwd)


def test_status_and_streams_are_those_of_the_program() -> None:
    version = run(command(), "--version")
    assert (version.returncode, version.stderr) == (0, "")
    assert version.stdout == f"phasmid {phasmid.__version__}\n"
    usage = run(command(), "decode", "--no-such-option")
    assert (usage.returncode, usage.stdout) == (2, "")
    assert "--no-such-option" in usage.stderr
    unknown = run(command(), "profile", "show", "nobody")
    assert (unknown.returncode, unknown.stdout) == (2, "")
    assert unknown.stderr.startswith('phasmid: profile "nobody": ')


def test_command_ignores_modules_of_the_working_folder(tmp_path: Path) -> None:
    (tmp_path / "phasmid.py").write_text("raise SystemExit('shadowed')\n")
    assert run(command(), "--version", cwd=tmp_path).returncode == 0


def test_module_is_the_command() -> None:
    assert run(sys.executable, "-m", "phasmid", "--version").returncode == 0


def test_command_starts_without_numpy() -> None:
    program = "import sys, phasmid._main; sys.exit('numpy' in sys.modules)"
    assert run(sys.executable, "-c", program).returncode == 0


def test_closed_pipe_is_no_error() -> None:
    with started(command(), "profile", "show", "pmp-bench") as process:
        process.stdout.close()
        process.stdout = None
        _, err = process.communicate(timeout=DEADLINE_S)
        assert (process.returncode, err) == (0, "")


def test_demo_runs_and_ends_at_ctrl_c(tmp_path: Path) -> None:
    small = ["--profile", "webcam-grey", "--scene", "sphere"]
    done = run(command(), "demo", *small, "--out", "demo", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)
    assert (tmp_path / "demo" / "cloud.ply").is_file()

    # Renders for long enough to be interrupted.
    slow = ["demo", "--samples", "64"]
    with started(command(), *slow, "--out", str(tmp_path / "slow")) as process:
        wait_until("the output folder", lambda: len(list(tmp_path.iterdir())) > 1)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=DEADLINE_S)
        assert process.returncode == 1, err
        assert "interrupted" in err
    assert [entry.name for entry in tmp_path.iterdir()] == ["demo"]


def test_serve_ends_at_ctrl_c(tmp_path: Path) -> None:
    at = tmp_path / "run"
    serve = ["serve", "--profile", "webcam-grey", "--scene", "plane", "--camera", "socket"]
    with started(command(), *serve, "--run-dir", str(at)) as process:
        wait_until("device.json", (at / "device.json").is_file)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=DEADLINE_S)
        assert process.returncode == 0, err
    assert not (at / "device.json").exists()


def test_study_ends_at_ctrl_c_and_records_the_extension(tmp_path: Path) -> None:
    study = [command(), "study", "noise", "--out", "noise"]
    with started(*study, cwd=tmp_path) as process:
        rows = tmp_path / "noise" / "rows.csv"
        wait_until("a row", lambda: rows.is_file() and rows.read_text().count("\n") > 2)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=DEADLINE_S)
        assert process.returncode == -signal.SIGINT
    extension = Path(_phasmid.__file__).read_bytes()
    assert f"program {zlib.crc32(extension):08x}" in rows.read_text()


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads the signals of a process")
def test_ignored_ctrl_c_stays_ignored(tmp_path: Path) -> None:
    at = tmp_path / "run"
    serve = ["serve", "--profile", "webcam-grey", "--scene", "plane", "--camera", "socket"]
    script = f"trap '' INT; exec {command()} {' '.join(serve)} --run-dir {at}"
    with started("sh", "-c", script) as process:
        wait_until("device.json", (at / "device.json").is_file)
        status = Path(f"/proc/{process.pid}/status").read_text()
        ignored = next(line for line in status.splitlines() if line.startswith("SigIgn:"))
        assert int(ignored.split()[1], 16) >> (signal.SIGINT - 1) & 1
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=DEADLINE_S)
        assert process.returncode == 0
