"""The decoder and the comparison with the truth."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import phasmid
import pytest
from conftest import small
from phasmid._decode import _array


@pytest.fixture(scope="module")
def device() -> phasmid.Device:
    return phasmid.Device(small(), "sphere", exact_calibration=True)


@pytest.fixture(scope="module")
def capture(device: phasmid.Device) -> phasmid.Capture:
    return device.scan()


def same(a: phasmid.Decoding, b: phasmid.Decoding) -> bool:
    maps = [(a.depth, b.depth), (a.depth_sigma, b.depth_sigma), (a.intensity, b.intensity)]
    assert a.x is not None and b.x is not None
    maps += [(a.x.coordinate, b.x.coordinate), (a.x.sigma, b.x.sigma)]
    return all(np.array_equal(p, q, equal_nan=True) for p, q in maps) and np.array_equal(a.verdict, b.verdict)


def test_every_form_of_frames_and_manifest_gives_the_same_maps(capture: phasmid.Capture) -> None:
    decoding = phasmid.decode(capture)
    assert decoding.depth is not None and decoding.depth.dtype == np.float32
    assert decoding.depth.shape == (120, 160) and decoding.x is not None
    assert np.array_equal(decoding.x.valid, np.isfinite(decoding.x.coordinate))
    assert capture.calibration is not None
    manifest, rig = capture.manifest, capture.calibration
    spread = np.zeros((13, 120, 320), dtype=np.uint8)
    spread[:, :, ::2] = capture.frames
    for frames in (capture.frames, spread[:, :, ::2], list(capture.frames), np.asfortranarray(capture.frames)):
        for sequence in (manifest, manifest.to_toml(), manifest.to_dict()):
            for calibration in (rig, rig.to_toml(), rig.to_dict()):
                assert same(phasmid.decode(frames, sequence, calibration), decoding)
    shifted = np.frombuffer(b"x" + capture.frames.astype(np.uint16).tobytes(), np.uint16, offset=1)
    assert not shifted.flags.aligned
    assert phasmid.decode(shifted.reshape(capture.frames.shape), manifest).x is not None
    decoder = phasmid.Decoder(manifest, 160, 120, rig)
    assert same(decoder.decode(capture), decoding)
    assert same(pickle.loads(pickle.dumps(decoder)).decode(capture.frames), decoding)
    assert same(pickle.loads(pickle.dumps(decoding)), decoding)


def test_contiguous_frames_are_read_where_they_are(capture: phasmid.Capture) -> None:
    frames = capture.frames.copy()
    frames.flags.writeable = False
    assert _array(frames) is frames
    decoding = phasmid.decode(frames, capture.manifest)
    assert decoding.depth is None and decoding.depth_sigma is None
    for array in (decoding.intensity, decoding.modulation, decoding.verdict):
        # Memory of the extension, without a copy.
        assert not array.flags.owndata and array.flags.writeable


def test_score_of_an_exact_rig(device: phasmid.Device, capture: phasmid.Capture) -> None:
    decoding = phasmid.decode(capture)
    truth = device.truth()
    score = phasmid.compare(decoding, truth, device.rig)
    assert score.coverage > 0.9 and score.gross_error_rate < 1e-2
    assert score.crease.points > 0
    assert decoding.depth is not None
    errors = (decoding.depth - truth.depth_mm)[(truth.flags & truth.CREASE == 0) & np.isfinite(decoding.depth)]
    errors = errors[np.abs(errors) < 1]
    assert np.sqrt(np.mean(np.square(errors, dtype=np.float64))) == pytest.approx(score.inlier_rmse_mm, rel=1e-4)
    # A change of the maps counts.
    decoding.depth += 0.5
    assert phasmid.compare(decoding, truth, device.rig).inlier_rmse_mm > 0.4


def test_cloud_has_a_row_for_each_depth(capture: phasmid.Capture, tmp_path: Path) -> None:
    decoding = phasmid.decode(capture)
    cloud = decoding.cloud()
    assert decoding.depth is not None and decoding.depth_sigma is not None
    valid = np.isfinite(decoding.depth)
    assert len(cloud) == valid.sum() and cloud.points.shape == cloud.normals.shape == (len(cloud), 3)
    assert np.allclose(cloud.points[:, 2], decoding.depth[valid])
    assert np.allclose(np.linalg.norm(cloud.normals, axis=1), 1, atol=1e-5)
    assert np.all(cloud.sigma_mm >= decoding.depth_sigma[valid] * 0.999)
    decoding.depth[:60] = np.nan
    assert len(decoding.cloud()) == valid[60:].sum()
    decoding.write_ply(tmp_path / "cloud.ply")
    assert f"element vertex {valid[60:].sum()}".encode() in (tmp_path / "cloud.ply").read_bytes()[:400]
    assert phasmid.decode(capture).summary()["points"] == len(cloud)


def test_archives_have_all_arrays(device: phasmid.Device, capture: phasmid.Capture, tmp_path: Path) -> None:
    decoding = phasmid.decode(capture)
    capture.to_npz(tmp_path / "capture.npz")
    decoding.to_npz(tmp_path / "decoding.npz")
    decoding.cloud().to_npz(tmp_path / "cloud.npz")
    device.truth().to_npz(tmp_path / "truth.npz")
    with np.load(tmp_path / "capture.npz") as archive:
        assert np.array_equal(archive["frames"], capture.frames)
        manifest, rig = str(archive["manifest"]), str(archive["calibration"])
        assert same(phasmid.decode(archive["frames"], manifest, rig), decoding)
    with np.load(tmp_path / "decoding.npz") as archive:
        assert {"x", "x_sigma", "x_verdict", "depth", "depth_sigma"} <= set(archive)
    with np.load(tmp_path / "cloud.npz") as archive:
        assert set(archive) == {"points", "normals", "intensity", "sigma_mm"}
    with np.load(tmp_path / "truth.npz") as archive:
        assert np.array_equal(archive["flags"], device.truth().flags)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: phasmid.decode(c.frames.astype(float), c.manifest), "an array of float64"),
        (lambda c: phasmid.decode(c.frames[0], c.manifest), "frames: 2 axes"),
        (lambda c: phasmid.decode(c.frames[:3], c.manifest), "3 frames; expected 13 frames"),
        (lambda c: phasmid.decode(c.frames[:, :0], c.manifest), "frames: 160 x 0"),
        (lambda c: phasmid.decode(c.frames), "manifest: None"),
        (lambda c: phasmid.decode(c.frames[:0], c.manifest), "frames"),
        (lambda c: phasmid.decode(c.frames.astype(">u2"), c.manifest), "an array of >u2"),
        (lambda c: phasmid.decode(c, held="maybe"), 'held: "maybe"'),
        (lambda c: phasmid.decode(c, mixed=True), "option: mixed"),
        (lambda c: phasmid.Decoder(c.manifest, 80, 60).decode(c), "160 x 120; expected 80 x 60"),
        (lambda c: phasmid.Decoder(c.manifest, 160, 120).decode("x"), "frames: "),
        (lambda c: phasmid.decode(c.frames, "frame = []"), "manifest:1"),
    ],
)
def test_mistakes_are_named(capture: phasmid.Capture, change: object, message: str) -> None:
    with pytest.raises((phasmid.InputError, phasmid.SeveralErrors)) as raised:
        change(capture)  # type: ignore[operator]
    assert message in str(raised.value)


def test_changed_maps_of_another_shape_are_refused(device: phasmid.Device, capture: phasmid.Capture) -> None:
    decoding = phasmid.decode(capture)
    assert decoding.depth is not None and decoding.x is not None
    decoding.depth = decoding.depth.astype(np.float64)  # type: ignore[assignment]
    with pytest.raises(phasmid.InputError, match="depth: an array of float64 .*; expected an array of f32"):
        decoding.cloud()
    decoding = phasmid.decode(capture)
    assert decoding.x is not None
    decoding.x.verdict[0, 0] = 99
    with pytest.raises(phasmid.InputError, match="x.verdict: 99; expected 0 to 6"):
        decoding.cloud()
    truth = device.truth()
    truth.flags = truth.flags[1:]
    with pytest.raises(phasmid.InputError, match="flags: "):
        phasmid.compare(phasmid.decode(capture), truth, device.rig)
