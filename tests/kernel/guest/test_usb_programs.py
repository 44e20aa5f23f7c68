"""Whole scans over USB by programs that know nothing of scanners: they record, a client of the port
triggers, `phasmid decode` makes the points."""

import sys

from lab import photographs
from lab.data_line import Line
from lab.device import Control, reference, reference_scan
from lab.failure import expect, limit, whole
from lab.guest import LANE, wait_until
from lab.profiles import FRAMES, GREY
from lab.streams import split
from lab.usb import plugged

# Number of frames to record: the sequence, and frames of the free-running camera before and after
# it.
COUNT = 40


def expect_decoded(scratch, folder, wanted):
    """What `phasmid decode` makes of the folder is what `phasmid scan` made."""
    decoded = scratch.dir / "decoded"
    scratch.phasmid(
        "decode", "--manifest", folder / "sequence.toml", "--calibration", folder / "calibration.toml",
        "--out", decoded,
    ).ok()
    for name in ("cloud.ply", "projector_x.npy", "sigma_x.npy", "mask.png"):
        expect(f"{name} as of `phasmid scan`", (decoded / name).read_bytes() == wanted[name], True)


def recorded(scratch, *command):
    """A sequence that is triggered by the USB port while a program records, in the middle of the
    free-running camera's frames."""
    rendered, wanted = reference(scratch, GREY), reference_scan(scratch, GREY)
    device = plugged(scratch, GREY)
    saved, folder = scratch.dir / "saved", scratch.dir / "photographs"
    port = Control(device.port)
    manifest, calibration = port.block("*CLS;:SEQ:DATA?"), port.block("CAL:DATA?")
    reader = scratch.start(*[str(part).replace("NODE", device.node).replace("SAVED", str(saved)) for part in command])
    wait_until("the first frame is recorded", lambda: saved.exists() and saved.stat().st_size > 0, 60)
    port.arm()
    port.run_sequence()
    port.run_free()
    reader.wait().ok()
    port.close()
    frames = split(saved.read_bytes(), GREY)
    expect("frames", len(frames), COUNT)
    ids = [Line(frame, GREY).id for frame in frames]
    expect("ids in order and never twice", ids, sorted(set(ids)))
    images = photographs.triggered(frames, GREY)
    expect("frames that are not as rendered", [i for i in range(FRAMES) if images[i] != rendered[i]], [])
    photographs.save(folder, images, manifest, calibration)
    expect_decoded(scratch, folder, wanted)
    device.stop()


@whole
def test_v4l2_ctl_records_a_scan(scratch):
    recorded(scratch, "v4l2-ctl", "-d", "NODE", "--stream-mmap=16", f"--stream-count={COUNT}", "--stream-to=SAVED")


@whole
def test_ffmpeg_records_a_scan(scratch):
    # Requests grey frames: the camera also offers YUYV, which ffmpeg would select, stretching its
    # luma to full range.
    recorded(
        scratch, "ffmpeg", "-nostdin", "-loglevel", "error", "-f", "v4l2", "-input_format", "gray", "-i", "NODE",
        "-frames:v", COUNT, "-vsync", "passthrough", "-f", "rawvideo", "-pix_fmt", "gray", "SAVED")


@whole
def test_gstreamer_records_a_scan(scratch):
    recorded(
        scratch, "gst-launch-1.0", "-q", "v4l2src", "device=NODE", f"num-buffers={COUNT}", "!",
        "video/x-raw,format=GRAY8", "!", "filesink", "location=SAVED")


@whole
@limit(180)  # loading OpenCV's libraries takes long in the emulated guest
def test_opencv_and_pyserial_scan(scratch):
    wanted = reference_scan(scratch, GREY)
    device = plugged(scratch, GREY)
    folder = scratch.dir / "photographs"
    scratch.run(
        sys.executable, "-s", LANE / "guest/opencv_scan.py", device.node, device.port, folder, seconds=150,
    ).ok()
    expect_decoded(scratch, folder, wanted)
    device.stop()
