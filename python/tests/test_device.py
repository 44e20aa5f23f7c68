"""Devices in memory and served, and scanners."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import phasmid
import pytest
from conftest import small


def test_frames_are_an_array_that_equal_seeds_reproduce() -> None:
    first, second, other = (phasmid.Device(small(), "sphere", seed=seed).scan() for seed in (1, 1, 2))
    assert first.frames.shape == (13, 120, 160) and first.frames.dtype == np.uint8
    assert first.frames.flags.c_contiguous and first.frames.flags.writeable
    assert np.array_equal(first.frames, second.frames) and not np.array_equal(first.frames, other.frames)
    assert len(first.manifest) == len(first.info) == 13
    assert [info.pattern_index for info in first.info] == list(range(13))
    assert all(info.exposure_start_ns < info.exposure_end_ns for info in first.info)
    assert first.idn.startswith("Phasmid,")
    assert first.calibration is not None and first.calibration.camera.width_px == 160


def test_deep_sensor_gives_16_bit_frames() -> None:
    profile = small().with_(**{"camera.format": "Y12", "camera.sensor.bits": 12, "camera.sensor.gain_dn_per_e": 0.3})
    frames = phasmid.Device(profile, "sphere").scan().frames
    assert frames.dtype == np.uint16 and frames.max() > 255


def test_control_port_answers_as_a_serial_port() -> None:
    control = phasmid.Device(small(), "plane").control
    assert control.query("*IDN?").startswith("Phasmid,")
    assert control.write(b"*IDN?\n*OPC?\n") == 12
    assert control.read(4) == b"Phas"
    assert control.readline().endswith(b"\n")
    assert control.readline() == b"1\n"
    assert control.readline() == b"" == control.read()


def test_truth_of_scan_frame_and_time() -> None:
    device = phasmid.Device(small(), "plane")
    with pytest.raises(phasmid.DeviceError, match="no scan"):
        device.truth()
    device.scan()
    truth = device.truth()
    assert truth.depth_mm.shape == (120, 160) and truth.point_mm.shape == (120, 160, 3)
    seen = truth.flags & truth.SEEN != 0
    assert np.array_equal(truth.point_mm[seen][:, 2], truth.depth_mm[seen])
    assert np.array_equal(truth.depth_mm, device.truth(frame=3).depth_mm, equal_nan=True)
    assert np.array_equal(truth.depth_mm, device.truth(time_s=0.1).depth_mm, equal_nan=True)
    with pytest.raises(phasmid.InputError, match="frame: 13; expected 0 to 12"):
        device.truth(frame=13)
    with pytest.raises(phasmid.InputError, match="time_s: -1"):
        device.truth(time_s=-1)
    x, y, z = device.scene.to_dict()["object"][0]["position_mm"]
    device.place(0, [x, y, z - 100], device.scene.to_dict()["object"][0]["rotation_deg"])
    device.scan()
    moved = device.truth().depth_mm[60, 80] - truth.depth_mm[60, 80]
    assert abs(moved) == pytest.approx(100, abs=1)


def test_time_passes_when_told() -> None:
    device = phasmid.Device(small(), "plane")
    before = device.time_s
    device.wait(2.5)
    assert device.time_s == pytest.approx(before + 2.5)
    with pytest.raises(phasmid.InputError, match="time_s: NaN"):
        device.wait(float("nan"))


def test_faults_strike_and_are_listed() -> None:
    device = phasmid.Device(small(), "plane", faults=[{"what": "dropped", "when": {"nth": 2}, "times": 1}])
    assert device.inject("dark", when={"nth": 1000}, times=1) == 2
    device.scan()
    struck = device.struck
    assert [(s.fault, s.what) for s in struck] == [(1, "dropped")] and struck[0].time_ns > 0
    device.clear_faults()
    device.scan()
    assert device.struck == struck
    with pytest.raises(phasmid.InputError, match="position_mm: .1, 2.; expected three numbers"):
        device.place(0, [1, 2])
    with pytest.raises(phasmid.InputError, match="object: -1; expected a whole number from 0"):
        device.place(-1, [1, 2, 3])
    with pytest.raises(phasmid.InputError, match='what: "dropt"; expected dropped, repeated'):
        device.inject("dropt")
    with pytest.raises(phasmid.InputError, match="unknown field `nht`"):
        phasmid.Device(small(), "plane", faults=[{"what": "dark", "when": {"nht": 1}}])


def test_progress_is_reported_and_may_raise() -> None:
    device = phasmid.Device(small(), "plane")
    seen: list[tuple[int, int]] = []
    device.scan(progress=lambda done, of: seen.append((done, of)))
    assert seen[-1] == (13, 13)

    def refuse(done: int, of: int) -> None:
        raise KeyError(done)

    with pytest.raises(KeyError):
        device.scan(progress=refuse)
    assert len(device.scan(progress=True).frames) == 13


def test_documents_are_names_paths_dicts_and_objects(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('extends = "webcam-grey"\nname = "mine"\n[camera]\nwidth_px = 80\nheight_px = 60\n')
    fields = {"extends": "webcam-grey", "name": "mine", "camera": {"width_px": np.int64(80), "height_px": 60}}
    by_path, by_dict = phasmid.Profile(path), phasmid.Profile(fields)
    for profile in (path, str(path), by_path, fields, by_dict):
        assert phasmid.Device(profile, "plane").scan().frames.shape == (13, 60, 80)
    for document in (by_path, by_dict, by_dict.with_(**{"identity.serial": "2"}), phasmid.Scene("plane")):
        assert pickle.loads(pickle.dumps(document)) == document
    assert by_dict != by_dict.with_(**{"identity.serial": "2"})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: phasmid.Device("pmp-bensh"), 'profile "pmp-bensh": neither a built-in name'),
        (lambda: phasmid.Device("pmp-bench", samples=3), "samples: 3"),
        (lambda: phasmid.Device("pmp-bench", seed=-1), "seed: -1; expected a whole number from 0 to 1844"),
        (lambda: phasmid.Device(small(), "plane").serve(tcp=70000), "tcp: 70000; expected a whole number"),
        (lambda: phasmid.Device("pmp-bench", backend="cuda"), 'backend: "cuda"; expected "cpu"'),
        (lambda: phasmid.Device("pmp-bench", clock="slow"), "clock: 'slow'"),
        (lambda: phasmid.Device("pmp-bench").scan("x"), 'sequence: "x"; expected pmp-12'),
        (lambda: phasmid.Profile("pmp-bench").with_(**{"camera.widht_px": 3}), "did you mean `width_px`"),
        (lambda: phasmid.Profile("pmp-bench").with_(**{"object[0].albedo": 1}), "no such field"),
        (lambda: phasmid.Profile({"extends": "pmp-bench", "name": None}), "profile: "),
        (lambda: phasmid.Profile({"extends": "pmp-bench", "name": object()}), "value: <object"),
        (lambda: phasmid.Profile({"extends": "pmp-bench", "camera": {"f_number": float("nan")}}), "profile: "),
        (lambda: phasmid.Manifest("frame = 3"), "manifest:1"),
        (lambda: phasmid.Rig({"camera": {}}), "rig:"),
        (lambda: phasmid.Scanner.connect("socket:/missing", "/missing"), "--control /missing: no such file"),
        (lambda: phasmid.Scanner.connect("socket:x", "x", reply_timeout_s=-1), "reply_timeout_s: -1"),
    ],
)
def test_mistakes_are_named(make: object, message: str) -> None:
    with pytest.raises((phasmid.InputError, phasmid.SeveralErrors)) as raised:
        make()  # type: ignore[operator]
    assert message in str(raised.value)
    assert isinstance(raised.value, ValueError)
    assert str(pickle.loads(pickle.dumps(raised.value))) == str(raised.value)


def test_errors_have_the_fields_of_rust(tmp_path: Path) -> None:
    with pytest.raises(phasmid.InputError) as raised:
        phasmid.Device("pmp-bench").scan("x")
    error = raised.value
    assert (error.place, error.found) == ("sequence", '"x"') and error.expected.startswith("pmp-12")
    with pytest.raises(phasmid.OperatingSystemError) as missing:
        phasmid.Rig(tmp_path / "none.toml")
    assert isinstance(missing.value, OSError)
    assert missing.value.errno == 2 and missing.value.place.endswith("none.toml")
    assert str(pickle.loads(pickle.dumps(missing.value))) == str(missing.value)
    with pytest.raises(phasmid.SeveralErrors) as several:
        phasmid.Profile({"name": "x"})
    assert len(several.value.errors) == 2 and isinstance(several.value.errors[0], phasmid.InputError)


def test_served_device_is_scanned_by_its_addresses(tmp_path: Path) -> None:
    in_memory = phasmid.Device(small(), "sphere", seed=3).scan()
    notices: list[str] = []
    device = phasmid.Device(small(), "sphere", seed=3, clock="fast")
    with device.serve(tmp_path / "run", tcp=0, notice=notices.append) as serving:
        at = serving.endpoints
        assert at.run_dir == str(tmp_path / "run") and at.camera_tcp is not None
        for camera in (at.camera, at.camera_tcp):
            with phasmid.Scanner.connect(camera, at.control) as scanner:
                assert scanner.selected == "quick-4"
                capture = scanner.scan()
                assert capture.frames.shape == in_memory.frames.shape
                assert capture.manifest == in_memory.manifest
                assert scanner.truth().depth_mm.shape == (120, 160)
            with pytest.raises(phasmid.DeviceError, match="closed"):
                scanner.scan()
    with pytest.raises(phasmid.DeviceError, match="closed"):
        device.scan()
    serving.stop()
    assert not (tmp_path / "run" / "device.json").exists()
    with pytest.raises(phasmid.InputError, match="--control"):
        phasmid.Scanner.connect(at.camera, at.control)


def test_run_directory_in_use_is_refused(tmp_path: Path) -> None:
    with phasmid.Device(small(), "plane").serve(tmp_path):
        with pytest.raises(phasmid.Error, match=str(tmp_path)):
            phasmid.Device(small(), "plane").serve(tmp_path)


def test_closed_device_says_so() -> None:
    with phasmid.Device(small(), "plane") as device:
        device.scan()
    with pytest.raises(phasmid.DeviceError, match="device: it is closed"):
        device.scan()
    device.close()


def test_repr_tells_what_it_is() -> None:
    device = phasmid.Device(small(), "plane")
    capture = device.scan()
    assert repr(device) == "<phasmid.Device 'small' in front of 'plane'>"
    assert repr(capture).startswith("<phasmid.Capture of 13 frames, 160 x 120 px, uint8, 'Phasmid,")
    assert repr(device.truth()) == "<phasmid.Truth of 160 x 120 px>"
    assert repr(capture.manifest) == "<phasmid.Manifest of 13 patterns, 854 x 480 px>"
    assert repr(device.rig) == "<phasmid.Rig: camera 160 x 120 px, projector 854 x 480 px>"
    assert repr(device.control) == "<phasmid.Control of 'small'>"


def test_every_name_is_there() -> None:
    assert sorted(phasmid._HOMES) == phasmid.__all__
    assert set(phasmid.__all__) <= set(dir(phasmid))
    for name in phasmid.__all__:
        assert getattr(phasmid, name).__doc__, name
    with pytest.raises(AttributeError, match="has no attribute 'Devise'"):
        phasmid.Devise
