"""Holds a calibration of ours against OpenCV.

    phasmid calibrate --profile pmp-bench --poses 8 --keep-captures --out DIR
    python tests/opencv_calibration.py target/release/phasmid DIR

Needs Python 3.11 and `pip install opencv-python-headless numpy`. Exits 0 when OpenCV reads our files
with the numbers of calibration.toml, calibrates camera and projector from our points to the same
rig, and when we read what OpenCV writes. It shares no code with the crate.
"""

import collections
import csv
import pathlib
import subprocess
import sys
import tempfile
import tomllib

import cv2
import numpy as np

# Maximum difference of two estimates from the same points, in standard deviations. Our estimate
# weights each point by its own noise and includes the projector's points; OpenCV's camera
# calibration does neither. The variance of the difference between an efficient estimate and another
# estimate is at most the variance of the other.
FEW = 5.0


def expect(what, good, found):
    if not good:
        sys.exit(f"{what}: {found}")
    print(f"ok  {what}: {found}")


def lens_of(view):
    lens = view["lens"]
    (fx, fy), (cx, cy) = lens["focal_px"], lens["principal_px"]
    k = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    distortion = np.array(lens.get("distortion", [0.0] * 5))
    return k, distortion, (lens["width_px"], lens["height_px"])


def pose_of(view):
    pose = view["rig_from_view"]
    return np.array(pose["rotation"]), np.array(pose["translation_mm"])


class Rig:
    """calibration.toml as OpenCV would say it: X_p = R X_c + T."""

    def __init__(self, path):
        table = tomllib.loads(path.read_text())
        self.camera = lens_of(table["camera"])
        self.projector = lens_of(table["projector"])
        rc, tc = pose_of(table["camera"])
        rp, tp = pose_of(table["projector"])
        self.r = rp.T @ rc
        self.t = rp.T @ (tc - tp)


def read_files(folder, rig):
    for name in ("calibration.yml", "calibration.xml"):
        storage = cv2.FileStorage(str(folder / name), cv2.FILE_STORAGE_READ)
        expect(name, storage.isOpened(), "read by cv2.FileStorage")
        matrix = lambda node: storage.getNode(node).mat()
        number = lambda node: storage.getNode(node).real()
        for names in (
            ("camera_matrix", "distortion_coefficients", "image_width", "image_height")
            + ("projector_matrix", "projector_distortion_coefficients")
            + ("projector_width", "projector_height", "R", "T"),
            ("Kc", "kc", "frameWidth", "frameHeight", "Kp", "kp", "screenResX", "screenResY", "Rp", "Tp"),
        ):
            kc, dc, cw, ch, kp, dp, pw, ph, r, t = names
            for lens, (k, d, w, h) in ((rig.camera, (kc, dc, cw, ch)), (rig.projector, (kp, dp, pw, ph))):
                same = np.array_equal(matrix(k), lens[0]) and np.array_equal(matrix(d).ravel(), lens[1])
                size = (number(w), number(h))
                expect(f"{name}: {k}, {d}", same and size == lens[2], "to the last bit")
            off = max(np.abs(matrix(r) - rig.r).max(), np.abs(matrix(t).ravel() - rig.t).max())
            expect(f"{name}: {r}, {t}", off < 1e-9, f"{off:.1e} off")
        storage.release()


def read_points(path):
    """Per pose: board points in mm, camera pixels, projector pixels; without outliers."""
    poses = collections.defaultdict(list)
    with path.open(newline="") as file:
        for row in csv.DictReader(file):
            projector = [row["projector_u_px"], row["projector_v_px"]]
            if all(projector) and float(row["weight"]) > 0.5:
                fields = ("board_x_mm", "board_y_mm", "camera_u_px", "camera_v_px")
                numbers = [float(row[field]) for field in fields] + [float(x) for x in projector]
                poses[row["pose"]].append(numbers)
    lists = [np.array(rows) for rows in poses.values() if len(rows) >= 20]
    flat = [np.column_stack([rows[:, :2], np.zeros(len(rows))]) for rows in lists]
    as_f32 = lambda columns: [np.ascontiguousarray(c, dtype=np.float32) for c in columns]
    return as_f32(flat), as_f32(r[:, 2:4] for r in lists), as_f32(r[:, 4:6] for r in lists)


def deviations(path):
    """Residuals in points.csv against the sigmas beside them."""
    with path.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if float(row["weight"]) > 0.5]
    for view in ("camera", "projector"):
        ratios = [
            float(row[f"{view}_residual_{axis}_px"]) / float(row[f"{view}_sigma_{axis}_px"])
            for row in rows
            for axis in "uv"
            if row[f"{view}_residual_{axis}_px"]
        ]
        rms = np.sqrt(np.mean(np.square(ratios)))
        expect(f"points.csv: {view} residual over sigma", 0.8 < rms < 1.25, f"RMS {rms:.3f}")


def flags_for(distortion):
    """OpenCV's flags that leave the same coefficients free."""
    k1, k2, p1, p2, k3 = distortion
    flags = 0
    for k, flag in ((k1, cv2.CALIB_FIX_K1), (k2, cv2.CALIB_FIX_K2), (k3, cv2.CALIB_FIX_K3)):
        flags |= 0 if k else flag
    return flags if p1 or p2 else flags | cv2.CALIB_ZERO_TANGENT_DIST


def calibrate(what, board, pixels, lens):
    k, distortion, size = lens
    # Starts away from the solution, so that OpenCV has to find it. OpenCV rejects a principal point
    # outside of the image, as a projector with lens shift has, so the size is enlarged. With an
    # initial guess, OpenCV uses the size for nothing else.
    size = [int(max(w, 2.0 * c)) for w, c in zip(size, k[:2, 2])]
    guess = k.copy()
    guess[0, 0] *= 1.03
    guess[1, 1] *= 1.03
    guess[:2, 2] += (15.0, -10.0)
    flags = flags_for(distortion) | cv2.CALIB_USE_INTRINSIC_GUESS
    stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 500, 1e-14)
    rms, found, coefficients, _, _, deviations, _, _ = cv2.calibrateCameraExtended(
        board, pixels, size, guess, np.zeros(5), flags=flags, criteria=stop
    )
    ours = np.concatenate([k[[0, 1, 0, 1], [0, 1, 2, 2]], distortion])
    theirs = np.concatenate([found[[0, 1, 0, 1], [0, 1, 2, 2]], coefficients.ravel()[:5]])
    print(f"    {what}: cv2 RMS {rms:.4f} px over {len(board)} poses, {sum(map(len, board))} points")
    for i, name in enumerate(("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")):
        off, deviation = theirs[i] - ours[i], deviations.ravel()[i]
        if deviation == 0.0:
            expect(f"{what} {name}", off == 0.0, "not estimated")
        else:
            words = f"ours {ours[i]:.6g}, cv2 {theirs[i]:.6g} +- {deviation:.2g}, {off / deviation:+.2f}"
            expect(f"{what} {name}", abs(off) <= FEW * deviation, words)


def stereo(board, camera_px, projector_px, rig):
    """R and T of stereoCalibrate, compared where they matter: in the projector's pixels."""
    stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 500, 1e-14)
    flags = cv2.CALIB_USE_INTRINSIC_GUESS | flags_for(rig.camera[1] + rig.projector[1])
    (kc, dc, size), (kp, dp, _) = rig.camera, rig.projector
    rms, kc2, dc2, kp2, dp2, r, t, _, _ = cv2.stereoCalibrate(
        board, camera_px, projector_px, kc.copy(), dc.copy(), kp.copy(), dp.copy(), size,
        flags=flags, criteria=stop,
    )
    u, v = np.meshgrid(np.linspace(0.25, 0.75, 9) * size[0], np.linspace(0.2, 0.8, 7) * size[1])
    pixels = np.column_stack([u.ravel(), v.ravel()])
    distance = 2.5 * np.linalg.norm(rig.t)
    worst = 0.0
    for depth in (0.9 * distance, distance, 1.1 * distance):
        places = []
        for k, d, rotation, translation, kpr, dpr in (
            (kc, dc, rig.r, rig.t, kp, dp),
            (kc2, dc2, r, t.ravel(), kp2, dp2),
        ):
            rays = cv2.undistortPoints(pixels.reshape(-1, 1, 2), k, d).reshape(-1, 2)
            points = np.column_stack([rays, np.ones(len(rays))]) * depth
            rvec = cv2.Rodrigues(rotation)[0]
            places.append(cv2.projectPoints(points, rvec, translation, kpr, dpr)[0].reshape(-1, 2))
        worst = max(worst, np.abs(places[0] - places[1]).max())
    words = f"RMS {rms:.4f} px, T {np.round(t.ravel(), 3)} mm, worst {worst:.3f} px of the projector"
    expect("cv2.stereoCalibrate", worst < 1.0, words)


def write_files(folder, rig):
    """The calibration as cv2 and SLStudio would write it."""
    f32 = np.float32
    (kc, dc, (cw, ch)), (kp, dp, (pw, ph)) = rig.camera, rig.projector
    for name, names, kind in (
        ("cv2.yml", None, np.float64),
        ("cv2.xml", None, np.float64),
        ("cv2.json", None, np.float64),
        ("slstudio.xml", ("Kc", "kc", "Kp", "kp", "Rp", "Tp"), f32),
    ):
        storage = cv2.FileStorage(str(folder / name), cv2.FILE_STORAGE_WRITE)
        ours = ("camera_matrix", "distortion_coefficients", "projector_matrix")
        ours += ("projector_distortion_coefficients", "R", "T")
        values = (kc, dc.reshape(5, 1), kp, dp.reshape(5, 1), rig.r, rig.t.reshape(3, 1))
        for node, value in zip(names or ours, values):
            storage.write(node, value.astype(kind))
        sizes = ("frameWidth", "frameHeight", "screenResX", "screenResY")
        if names is None:
            sizes = ("image_width", "image_height", "projector_width", "projector_height")
        for node, value in zip(sizes, (cw, ch, pw, ph)):
            storage.write(node, value)
        storage.release()
        yield folder / name, 1e-3 if kind is np.float64 else 0.05


def decoded(phasmid, capture, calibration, out):
    command = [phasmid, "decode", "--manifest", capture / "sequence.toml", "--calibration", calibration]
    subprocess.run([*map(str, command), "--out", str(out)], check=True, stdout=subprocess.DEVNULL)
    return np.load(out / "depth.npy")


def read_back(phasmid, capture, folder, rig):
    """Depths with what cv2 has written, against those with calibration.toml."""
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        # OpenCV's files do not contain the camera's noise model. It is removed here too, so that
        # the decoder estimates the noise in all runs.
        rig_only = (folder / "calibration.toml").read_text().split("[noise]")[0]
        (scratch / "rig.toml").write_text(rig_only)
        wanted = decoded(phasmid, capture, scratch / "rig.toml", scratch / "toml")
        for path, bound in write_files(scratch, rig):
            depth = decoded(phasmid, capture, path, scratch / path.name.replace(".", "-"))
            same = np.array_equal(np.isnan(depth), np.isnan(wanted))
            # A few pixels at the limit of the allowed error may be masked in only one of the runs.
            same = same or (np.isnan(depth) != np.isnan(wanted)).sum() < 10
            off = np.nanmax(np.abs(depth - wanted))
            expect(f"phasmid decode --calibration {path.name}", same and off < bound, f"{off:.1e} mm off")


def main():
    phasmid, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    print(f"OpenCV {cv2.__version__}")
    rig = Rig(folder / "calibration.toml")
    read_files(folder, rig)
    board, camera_px, projector_px = read_points(folder / "points.csv")
    deviations(folder / "points.csv")
    calibrate("camera", board, camera_px, rig.camera)
    calibrate("projector", board, projector_px, rig.projector)
    stereo(board, camera_px, projector_px, rig)
    captures = sorted((folder / "captures").glob("*/sequence.toml"))
    expect("captures", bool(captures), f"{len(captures)} of --keep-captures")
    read_back(phasmid, captures[0].parent, folder, rig)


main()
