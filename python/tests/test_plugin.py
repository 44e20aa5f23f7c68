"""The plugin of pytest."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import phasmid
import pytest
from conftest import DEADLINE_S, command

pytest_plugins = ["pytester"]

LOOPBACK = '''
import phasmid
import pytest

@pytest.mark.phasmid(profile="webcam-grey", scene="plane", link="pty")
def test_lost_frame_is_detected_and_repeated(phasmid_device: phasmid.Serving) -> None:
    phasmid_device.service.inject("dropped", when={"nth": 3}, times=1)
    at = phasmid_device.endpoints
    with phasmid.Scanner.connect(at.camera, at.control) as scanner:
        capture = scanner.scan()
    assert phasmid_device.service.struck[0].what == "dropped"
    assert [info.pattern_index for info in capture.info] == list(range(13))
'''


def test_loopback_test_with_a_fault_has_at_most_15_lines(pytester: pytest.Pytester) -> None:
    assert len(LOOPBACK.strip().splitlines()) <= 15
    pytester.makepyfile(LOOPBACK)
    result = pytester.runpytest_subprocess("--durations=0", "-v")
    result.assert_outcomes(passed=1)


def test_marks_nearer_to_the_test_take_precedence(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        import phasmid
        import pytest

        pytestmark = pytest.mark.phasmid(profile="webcam-grey", scene="plane", seed=3)

        def test_module(phasmid_device):
            assert isinstance(phasmid_device, phasmid.Device)
            assert repr(phasmid_device) == "<phasmid.Device 'webcam-grey' in front of 'plane'>"

        @pytest.mark.phasmid(scene="sphere", faults=[{"what": "dropped", "when": {"nth": 2}, "times": 1}])
        def test_function(phasmid_device):
            assert phasmid_device.scene.name == "sphere"
            phasmid_device.scan("quick-4")
            assert [struck.what for struck in phasmid_device.struck] == ["dropped"]

        @pytest.mark.phasmid(link="usb")
        def test_usb(phasmid_device):
            at = phasmid_device.endpoints
            with phasmid.Scanner.connect(at.usb, at.control) as scanner:
                assert len(scanner.scan().frames) == 13
        """
    )
    # Several processes, as pytest-xdist starts them.
    pytester.runpytest_subprocess("-n", "2").assert_outcomes(passed=3)


def test_station_serves_its_devices_with_one_scene(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        import phasmid
        import pytest

        @pytest.mark.phasmid(scene="plane", seed=2, faults=[{"what": "late", "by_ms": 1, "device": "left"}])
        def test_station(phasmid_station):
            assert sorted(phasmid_station) == ["left", "right"]
            for name, pod in phasmid_station.items():
                at = pod.endpoints
                with phasmid.Scanner.connect(at.camera, at.control) as scanner:
                    assert len(scanner.scan().frames) == 13
                assert bool(pod.service.struck) == (name == "left")
            before, after = (pod.service.ask({"get": "objects"})["scene"] for pod in phasmid_station.values())
            assert before["objects"] == after["objects"]
        """
    )
    # A module of this name in the working directory must not be started.
    pytester.path.joinpath("phasmid.toml").write_text("")
    pytester.runpytest_subprocess().assert_outcomes(passed=1)


def test_report_of_a_failed_test_has_logs_and_recordings(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        import phasmid
        import pytest

        pytestmark = pytest.mark.phasmid(profile="webcam-grey", scene="plane")

        def test_memory(phasmid_device):
            phasmid_device.control.query("*IDN?")
            capture = phasmid_device.scan("quick-4")
            assert capture is None

        @pytest.mark.phasmid(link="pty")
        def test_served(phasmid_device):
            at = phasmid_device.endpoints
            with phasmid.Scanner.connect(at.camera, at.control) as scanner:
                scanner.scan()
            raise KeyError

        def test_passes(phasmid_device):
            pass
        """
    )
    result = pytester.runpytest_subprocess("--basetemp", str(pytester.path / "temp"))
    result.assert_outcomes(passed=1, failed=2)
    text = result.stdout.str()
    assert text.count("- phasmid -") == 2
    assert "sent b'*IDN?\\n'" in text and "received b'Phasmid,webcam-grey" in text
    folder = pytester.path / "temp"
    assert (folder / "test_memory0" / "capture.npz").is_file()
    assert not (folder / "test_passes0" / "capture.npz").exists()
    recording = folder / "test_served0" / "device.phasmid"
    info = subprocess.run(
        [command(), "record", "info", recording], capture_output=True, text=True, timeout=DEADLINE_S
    )
    assert info.returncode == 0, info.stderr
    assert "13" in info.stdout


@pytest.mark.parametrize(
    ("mark", "message"),
    [
        ('link="ptty"', "link='ptty'; expected"),
        ('"webcam-grey"', "expected arguments with names"),
        ('profile="webcam-gray"', "webcam-gray"),
        ("shape=1", "unexpected keyword argument 'shape'"),
    ],
)
def test_mistakes_in_a_mark_are_named(pytester: pytest.Pytester, mark: str, message: str) -> None:
    pytester.makepyfile(
        f"""
        import pytest

        @pytest.mark.phasmid({mark})
        def test(phasmid_device):
            pass
        """
    )
    result = pytester.runpytest_subprocess()
    result.assert_outcomes(errors=1)
    assert message in result.stdout.str()


def test_long_paths_of_tests_get_a_private_run_directory(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(LOOPBACK)
    deep = pytester.path / ("deep" * 20)
    deep.mkdir()
    pytester.runpytest_subprocess("--basetemp", str(deep / "temp")).assert_outcomes(passed=1)


def test_unused_plugin_does_not_import_numpy() -> None:
    program = "import sys, pytest, phasmid._pytest; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], timeout=DEADLINE_S).returncode == 0


def test_recording_of_a_served_device_is_new(tmp_path: Path) -> None:
    path = tmp_path / "there"
    path.write_text("mine")
    with pytest.raises(phasmid.InputError, match="there"):
        phasmid.Device("webcam-grey", "plane").serve(record=path)
    assert path.read_text() == "mine"
