"""Programs that only stream see the free-running camera."""

from lab import loopback
from lab.device import Device, FrameSocket
from lab.failure import expect, whole
from lab.profiles import GREY, YUYV
from lab.streams import expect_free_run, split

COUNT = 8
# The module may hand out a buffer that has not been returned yet; GStreamer then fails with this
# message.
MODULES_OWN = "Failed to allocate a buffer"


def viewed(scratch, variation, *command):
    """What a viewer saves: frames in order, each as the camera renders it. Without noise all of
    them are alike."""
    still = Device(scratch, variation, "socket", "--no-noise", name="reference").ready()
    socket = FrameSocket(still)
    image = variation.image(socket.frame())
    socket.close()
    still.stop()
    loopback.load()
    device = Device(scratch, variation, loopback.PHASMID, "--no-noise").ready()
    saved = scratch.dir / "saved"
    for _ in range(4):
        done = scratch.run(*[str(part).replace("SAVED", str(saved)) for part in command])
        if MODULES_OWN not in done.err:
            break
    done.ok()
    frames = split(saved.read_bytes(), variation)
    expect_free_run(frames, variation, COUNT)
    expect("images that are not as rendered",
           [i for i, frame in enumerate(frames) if variation.image(frame) != image], [])
    device.stop()


def test_ffmpeg_reads_grey(scratch):
    viewed(
        scratch, GREY, "ffmpeg", "-nostdin", "-loglevel", "error", "-f", "v4l2", "-i", loopback.PHASMID,
        "-frames:v", COUNT, "-vsync", "passthrough", "-f", "rawvideo", "-pix_fmt", "gray", "SAVED")


@whole
def test_ffmpeg_reads_yuyv(scratch):
    viewed(
        scratch, YUYV, "ffmpeg", "-nostdin", "-loglevel", "error", "-f", "v4l2", "-i", loopback.PHASMID,
        "-frames:v", COUNT, "-vsync", "passthrough", "-f", "rawvideo", "-pix_fmt", "yuyv422", "SAVED")


@whole
def test_gstreamer_reads_grey(scratch):
    viewed(
        scratch, GREY, "gst-launch-1.0", "-q", "v4l2src", f"device={loopback.PHASMID}",
        f"num-buffers={COUNT}", "!", "video/x-raw,format=GRAY8", "!", "filesink", "location=SAVED")


def test_gstreamer_reads_yuyv(scratch):
    viewed(
        scratch, YUYV, "gst-launch-1.0", "-q", "v4l2src", f"device={loopback.PHASMID}",
        f"num-buffers={COUNT}", "!", "video/x-raw,format=YUY2", "!", "filesink", "location=SAVED")
