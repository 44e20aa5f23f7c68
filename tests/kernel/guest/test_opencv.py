"""A whole scan driven from Python with OpenCV and pyserial, decoded afterwards."""

import sys

from lab import loopback
from lab.device import Device, reference_scan
from lab.failure import expect, limit
from lab.guest import LANE
from lab.profiles import GREY


@limit(180)  # loading OpenCV's libraries takes long in the emulated guest
def test_a_scan_in_python_gives_the_same_points(scratch):
    wanted = reference_scan(scratch, GREY)
    loopback.load()
    device = Device(scratch, GREY, loopback.PHASMID).ready()
    folder, decoded = scratch.dir / "photographs", scratch.dir / "decoded"
    scratch.run(
        sys.executable, "-s", LANE / "guest/opencv_scan.py", device.camera,
        device.endpoints["control"], folder, seconds=150,
    ).ok()
    scratch.phasmid(
        "decode", "--manifest", folder / "sequence.toml", "--calibration", folder / "calibration.toml",
        "--out", decoded,
    ).ok()
    for name in ("cloud.ply", "projector_x.npy", "sigma_x.npy", "mask.png"):
        expect(f"{name} as of `phasmid scan`", (decoded / name).read_bytes() == wanted[name], True)
    device.stop()
