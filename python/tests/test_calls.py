"""Ctrl-C, threads, forked children and memory."""

from __future__ import annotations

import multiprocessing
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any, cast

import phasmid
import pytest
from conftest import DEADLINE_S, small, started, wait_until

SLOW = "phasmid.Device('pmp-bench', 'torso', samples=64)"
#: Calls that take seconds, after what they need.
LONG = {
    "scan": (f"device = {SLOW}", "device.scan()"),
    "scan of a served device": (
        f"serving = {SLOW}.serve(); at = serving.endpoints\n"
        "scanner = phasmid.Scanner.connect(at.camera, at.control, frame_timeout_s=60)",
        "scanner.scan()",
    ),
    "connect": (
        "import os, pty; _, port = pty.openpty()",
        "phasmid.Scanner.connect('socket:/missing', os.ttyname(port), reply_timeout_s=60)",
    ),
    "serving": (f"serving = {SLOW}.serve()", "import time; time.sleep(60)"),
}


@pytest.mark.parametrize("name", LONG)
def test_ctrl_c_ends_a_long_call(name: str) -> None:
    before, call = LONG[name]
    program = f"import phasmid\n{before}\ntry:\n    print('begin', flush=True)\n    {call}\n    print('ran to its end')\n"
    program += "except KeyboardInterrupt:\n    print('interrupted', flush=True)\n"
    program += "capture = phasmid.Device('webcam-grey', 'plane').scan()\nprint(len(capture.frames))"
    with started(sys.executable, "-c", program) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "begin\n"
        time.sleep(0.2)  # So that the call has begun; it also ends if it has not.
        process.send_signal(signal.SIGINT)
        begin = time.monotonic()
        line = process.stdout.readline()
        took = time.monotonic() - begin
        out, err = process.communicate(timeout=DEADLINE_S)
        assert (line, out, process.returncode) == ("interrupted\n", "13\n", 0), err
        # On an idle machine at most 0.13 s.
        assert took < 2


def test_library_installs_no_signal_handlers(tmp_path: Path) -> None:
    def handled() -> int:
        status = Path("/proc/self/status").read_text().splitlines()
        mask = int(next(line for line in status if line.startswith("SigCgt:")).split()[1], 16)
        # Signals 32 and 33 are those of the C library, for threads.
        return mask & 0x7FFF_FFFF

    before = handled()
    with phasmid.Device(small(), "plane", clock="fast").serve(tmp_path) as serving:
        at = serving.endpoints
        with phasmid.Scanner.connect(at.camera, at.control) as scanner:
            phasmid.decode(scanner.scan())
    assert handled() == before


def test_threads_share_a_device_and_run_beside_python() -> None:
    device = phasmid.Device(small(), "sphere", seed=1)
    captures: list[phasmid.Capture] = []
    ticks, done = 0, threading.Event()

    def work() -> None:
        captures.extend(device.scan() for _ in range(3))

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    threading.Thread(target=lambda: ([thread.join() for thread in threads], done.set())).start()
    while not done.wait(0.001):
        ticks += 1
    assert len(captures) == 12 and len({capture.info[0].id for capture in captures}) == 12
    assert ticks > 1


def _scan_in_child(seed: int) -> int:
    capture = phasmid.Device(small(), "sphere", seed=seed).scan()
    return int(phasmid.decode(capture).summary()["points"])


@pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning")
@pytest.mark.parametrize("method", ["fork", "spawn", "forkserver"])
def test_children_of_each_kind_scan_after_the_parent_has(method: str) -> None:
    points = _scan_in_child(1)
    with multiprocessing.get_context(method).Pool(2) as pool:
        assert pool.map_async(_scan_in_child, [1, 1, 1]).get(DEADLINE_S) == [points] * 3


def in_fork(work: str, environment: dict[str, str] | None = None) -> str:
    """Run a program of its own, which may fork, and return what it prints."""
    program = f"""
import os, sys, threading, time, warnings, phasmid
warnings.simplefilter('ignore')
small = phasmid.Profile({{'extends': 'webcam-grey', 'name': 'small', 'camera': {{'width_px': 160, 'height_px': 120}}}})
{work}
"""
    ran = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        env={**os.environ, **(environment or {})},
    )
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


def test_forked_child_uses_a_device_of_its_parent() -> None:
    printed = in_fork(
        "device = phasmid.Device(small, 'plane'); device.scan()\n"
        "child = os.fork()\n"
        "# One write each, since both may print at once.\n"
        "os.write(1, b'%d\\n' % len(device.scan().frames))\n"
        "if child: sys.exit(os.waitpid(child, 0)[1])\n"
    )
    assert printed.split() == ["13", "13"]


def test_fork_during_a_scan_of_another_thread_is_an_error_in_the_child() -> None:
    printed = in_fork(
        "device = phasmid.Device('pmp-bench', 'torso', samples=16)\n"
        "begun = threading.Event()\n"
        "def scan():\n"
        "    while True: device.scan(progress=lambda done, of: begun.set())\n"
        "threading.Thread(target=scan, daemon=True).start(); begun.wait()\n"
        "child = os.fork()\n"
        "# Without an end of the interpreter, which the other thread may not survive.\n"
        "if child: os._exit(os.waitpid(child, 0)[1])\n"
        "try: device.scan()\n"
        "except phasmid.DeviceError as error: print(error)\n"
        "print(len(phasmid.Device(small, 'plane').scan().frames))\n"
    )
    assert "another thread was using it when this process was forked" in printed
    assert printed.split()[-1] == "13"


def test_forked_child_leaves_a_served_device_to_its_parent(tmp_path: Path) -> None:
    printed = in_fork(
        f"serving = phasmid.Device(small, 'plane', clock='fast').serve({str(tmp_path)!r})\n"
        "child = os.fork()\n"
        "if not child: serving.stop(); del serving; sys.exit(0)\n"
        "status = os.waitpid(child, 0)[1]; at = serving.endpoints\n"
        "with phasmid.Scanner.connect(at.camera, at.control) as scanner: print(len(scanner.scan().frames))\n"
        "sys.exit(status)\n"
    )
    assert printed == "13\n"


def test_end_of_the_interpreter_ends_served_devices(tmp_path: Path) -> None:
    program = f"import phasmid; serving = phasmid.Device('webcam-grey', 'plane').serve({str(tmp_path)!r}, notice=print)"
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=DEADLINE_S)
    assert (ran.returncode, ran.stderr) == (0, "")
    assert not (tmp_path / "device.json").exists()


def test_memory_does_not_grow() -> None:
    camera = {"width_px": 64, "height_px": 48}
    profile = phasmid.Profile({"extends": "webcam-grey", "name": "tiny", "camera": camera})

    def rss() -> int:
        pages = Path("/proc/self/statm").read_text().split()[1]
        return int(pages) * os.sysconf("SC_PAGE_SIZE")

    def use(devices: int, scans: int) -> None:
        for _ in range(devices):
            device = phasmid.Device(profile, "plane")
            for _ in range(scans):
                capture = device.scan()
            phasmid.compare(phasmid.decode(capture), device.truth(), device.rig).coverage

    use(20, 10)
    before = rss()
    # A tenth of the numbers that `bench.py` checks.
    use(100, 10)
    assert rss() - before < 5e6


def test_scans_that_wait_keep_no_other_call_from_running(tmp_path: Path) -> None:
    # Each scan waits for the trigger of a clock that only the end of this test moves.
    work = f"""
servings = [phasmid.Device(small, 'plane', clock='stepped').serve({str(tmp_path)!r} + f'/{{i}}') for i in range(3)]
ends = []
def scan(serving):
    at = serving.endpoints
    with phasmid.Scanner.connect(at.camera, at.control, frame_timeout_s={DEADLINE_S}) as scanner:
        ends.append(len(scanner.scan().frames))
threads = [threading.Thread(target=scan, args=[serving]) for serving in servings]
for thread in threads: thread.start()
print(len(phasmid.Device(small, 'plane').scan().frames), len(ends))
while any(thread.is_alive() for thread in threads):
    for serving in servings: serving.service.step(0.1)
print(ends)
"""
    printed = in_fork(work, {"RAYON_NUM_THREADS": "1"})
    assert printed == "13 0\n[13, 13, 13]\n"


def test_scanner_of_the_parent_is_an_error_in_a_forked_child(tmp_path: Path) -> None:
    printed = in_fork(
        f"serving = phasmid.Device(small, 'plane', clock='fast').serve({str(tmp_path)!r}); at = serving.endpoints\n"
        "scanner = phasmid.Scanner.connect(at.camera, at.control)\n"
        "child = os.fork()\n"
        "if child: status = os.waitpid(child, 0)[1]; print(len(scanner.scan().frames)); sys.exit(status)\n"
        "for call in (scanner.scan, scanner.truth, lambda: scanner.select('quick-4')):\n"
        "    try: call()\n"
        "    except phasmid.DeviceError as error: print(error, flush=True)\n"
        "scanner.finish(); del scanner\n"
        "os._exit(0)\n"
    )
    assert printed.count("scanner: it belongs to the process that this one was forked from") == 3
    assert printed.splitlines()[-1] == "13"


def test_forked_child_forgets_the_pods_of_its_parent(tmp_path: Path) -> None:
    printed = in_fork(
        f"serving = phasmid.Device(small, 'plane', clock='fast').serve({str(tmp_path)!r}); at = serving.endpoints\n"
        "pod = phasmid.Pod('p', phasmid.Scanner.connect(at.camera, at.control), (0, 0, 0), (0, 0, 0))\n"
        "child = os.fork()\n"
        "if child: status = os.waitpid(child, 0)[1]; pod.finish(); sys.exit(status)\n"
        "pod.finish(); del pod\n"
        "print('done', flush=True)\n"
        "os._exit(0)\n"
    )
    assert printed == "done\n"


def test_connection_that_nobody_waits_for_lets_the_camera_run_again(tmp_path: Path) -> None:
    program = (
        "import sys, phasmid\n"
        "try: print('begin', flush=True); phasmid.Scanner.connect(*sys.argv[1:], reply_timeout_s=200)\n"
        "except KeyboardInterrupt: print('interrupted', flush=True)\n"
        "sys.stdin.read()\n"
    )
    # Bytes take device time, which passes in steps.
    slow = small().with_(**{"control.baud": 9600})
    with phasmid.Device(slow, "plane", clock="stepped").serve(tmp_path / "run") as serving:
        at = serving.endpoints

        def device() -> dict[str, Any]:
            return cast("dict[str, Any]", serving.service.ask({"get": "device"})["device"])

        def passes_to(state: str) -> bool:
            serving.service.step(0.01)
            return bool(device()["state"] == state)

        # With a reader, the camera runs free from power-on.
        with socket.socket(socket.AF_UNIX) as reader:
            reader.connect(at.camera_socket.removeprefix("socket:"))
            wait_until("the camera runs", lambda: passes_to("free"))
            options = {"stdin": subprocess.PIPE}
            with started(sys.executable, "-c", program, at.camera, at.control, **options) as process:
                assert process.stdout is not None
                assert process.stdout.readline() == "begin\n"
                wait_until("the host asks", lambda: device()["bytes_in"] > 0)
                process.send_signal(signal.SIGINT)
                assert process.stdout.readline() == "interrupted\n"
                wait_until("the camera stops", lambda: passes_to("idle"))
                wait_until("the camera runs again", lambda: passes_to("free"))
                _, err = process.communicate(timeout=DEADLINE_S)
                assert process.returncode == 0, err


def test_progress_that_uses_its_device_is_an_error() -> None:
    device = phasmid.Device(small(), "plane")
    with pytest.raises(phasmid.DeviceError, match="device: a call of this thread is using it"):
        device.scan(progress=lambda done, of: device.time_s)
    assert device.time_s > 0 and len(device.scan(progress=False).frames) == 13


def test_forked_child_reads_the_factory_calibration() -> None:
    printed = in_fork(
        "rig = phasmid.Device(small, 'plane').factory_calibration\n"
        "child = os.fork()\n"
        "if child: sys.exit(os.waitpid(child, 0)[1])\n"
        "print(phasmid.Device(small, 'plane').factory_calibration == rig)\n"
    )
    assert printed == "True\n"
