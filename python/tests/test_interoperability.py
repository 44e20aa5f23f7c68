"""With other packages: serial ports, OpenCV, trimesh, scipy, and data loaders."""

from __future__ import annotations

import multiprocessing
import runpy
from pathlib import Path

import cv2
import numpy as np
import phasmid
import pytest
import pyvisa
import scipy.optimize
import scipy.spatial
import serial
import trimesh
from conftest import DEADLINE_S, small

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"


def test_pyserial_and_pyvisa_speak_to_a_served_device() -> None:
    with phasmid.Device(small(), "plane", clock="fast").serve() as serving:
        at = serving.endpoints
        with serial.Serial(at.control, timeout=DEADLINE_S) as port:
            port.write(b"*IDN?\nSEQ:SEL?\n")
            assert port.readline().decode().strip() == at.name
            assert port.readline() == b'"quick-4"\n'
        manager = pyvisa.ResourceManager("@py")
        instrument = manager.open_resource(f"ASRL{at.control}::INSTR", read_termination="\n", timeout=DEADLINE_S * 1000)
        assert instrument.query("*IDN?") == at.name
        instrument.close()
        manager.close()


def test_opencv_decodes_the_gray_code_that_it_has_made() -> None:
    gray = cv2.structured_light.GrayCodePattern.create(854, 480)
    patterns = np.stack(gray.generate()[1])
    capture, truth = phasmid.render(small(), "sphere", patterns=patterns, noise=False)
    gray.setWhiteThreshold(2)
    wanted = truth.SEEN | truth.LIT | truth.SQUARE
    usable = (truth.flags & (wanted | truth.CREASE)) == wanted
    off = []
    for y, x in np.argwhere(usable)[::20]:
        failed, (column, row) = gray.getProjPixel(list(capture.frames), int(x), int(y))
        if not failed:
            off.append((column - truth.projector_x[y, x], row - truth.projector_y[y, x]))
    assert len(off) > 0.9 * len(np.argwhere(usable)[::20])
    # A cell is a pixel wide, and a camera's pixel covers about one.
    assert np.median(np.abs(off)) < 1 and np.quantile(np.abs(off), 0.99) < 3


def test_opencv_calibrates_our_camera(tmp_path: Path) -> None:
    profile = phasmid.Profile("pmp-bench")
    board = phasmid.board("chess", scale=1.2)
    shape = {"kind": "board", "board": board, "ink": 0.06}
    scene = phasmid.Scene("board").with_(**{"object[0].shape": shape})
    projector = profile.to_dict()["projector"]
    size = {key: projector[key] for key in ("width_px", "height_px")}
    white = tmp_path / "white.toml"
    white.write_text(phasmid.Manifest({"projector": size, "frame": [{"pattern": {"kind": "white"}}]}).to_toml())
    device = phasmid.Device(profile, scene, sequences=[white])
    grid = np.zeros((9 * 6, 3), np.float32)
    grid[:, :2] = np.mgrid[0:9, 0:6].T.reshape(-1, 2) * board["pitch_mm"]
    objects, corners = [], []
    for pose in phasmid.board_poses(board, device.rig, count=8):
        device.place(0, *pose)
        frame = device.scan("white").frames[0]
        found, points = cv2.findChessboardCorners(frame, (9, 6))
        if found:
            criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)
            corners.append(cv2.cornerSubPix(frame, points, (5, 5), (-1, -1), criteria))
            objects.append(grid)
    assert len(objects) >= 6
    rms, matrix, *_ = cv2.calibrateCamera(objects, corners, frame.shape[::-1], None, None)
    assert rms < 0.2
    assert matrix[0, 0] == pytest.approx(device.rig.camera.matrix[0, 0], rel=0.01)
    # By our calibration, OpenCV projects the true points to the true projector pixels.
    truth, view = device.truth(), device.rig.projector
    seen = (truth.flags & truth.SEEN) != 0
    to_view, _ = cv2.Rodrigues(view.rotation.T)
    shift = -view.rotation.T @ view.translation_mm
    points = truth.point_mm[seen].astype(np.float64)
    pixels, _ = cv2.projectPoints(points, to_view, shift, view.matrix, view.distortion)
    assert np.allclose(pixels[:, 0, 0], truth.projector_x[seen], atol=0.01)
    assert np.allclose(pixels[:, 0, 1], truth.projector_y[seen], atol=0.01)


def test_trimesh_and_scipy_take_clouds() -> None:
    device = phasmid.Device(small(), "plane", exact_calibration=True)
    cloud = phasmid.decode(device.scan()).cloud()
    mesh = cloud.to_trimesh()
    assert isinstance(mesh, trimesh.PointCloud)
    assert np.array_equal(mesh.vertices, cloud.points) and len(mesh.colors) == len(cloud)
    points = cloud.points.astype(np.float64)
    centre = points.mean(axis=0)
    tree = scipy.spatial.cKDTree(points)
    assert tree.query(centre)[0] < 20

    def residuals(plane: np.ndarray) -> np.ndarray:
        return (points[:, 2] - centre[2] - (points[:, :2] - centre[:2]) @ plane[:2] - plane[2]) / cloud.sigma_mm

    fit = scipy.optimize.least_squares(residuals, np.zeros(3), loss="soft_l1")
    # The stated deviations are those of the points about the plane, up to rows that share an error.
    assert np.median(np.abs(fit.fun)) / 0.6745 == pytest.approx(1, abs=0.5)


def test_open3d_is_named_where_it_is_missing() -> None:
    cloud = phasmid.decode(phasmid.Device(small(), "plane").scan()).cloud()
    try:
        import open3d
    except ImportError:
        with pytest.raises(ImportError, match="open3d"):
            cloud.to_open3d()
    else:
        assert isinstance(cloud.to_open3d(), open3d.geometry.PointCloud)
        assert np.array_equal(np.asarray(cloud.to_open3d().points, dtype=np.float32), cloud.points)


def _sums(index: int) -> tuple[float, float]:
    scenes = runpy.run_path(str(EXAMPLES / "scenes.py"))["RandomScenes"](3, small())
    sample = scenes[index]
    return float(sample["frames"].sum()), float(sample["depth_mm"].sum())


@pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning")
def test_data_set_is_the_same_in_worker_processes() -> None:
    here = [_sums(index) for index in range(3)]
    assert len(set(here)) == 3
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert pool.map_async(_sums, range(3)).get(DEADLINE_S) == here


def test_data_set_runs_as_a_program(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(EXAMPLES / "scenes.py"), run_name="__main__")
    assert capsys.readouterr().out.count(" mm\n") == 4
