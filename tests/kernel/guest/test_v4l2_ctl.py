"""v4l2-ctl: lists the served camera, streams from it, and saves what was rendered."""

import re

from lab import loopback
from lab.data_line import Line
from lab.device import Device, reference
from lab.failure import expect, expect_in, expect_true, whole
from lab.guest import wait_until
from lab.profiles import FRAMES, GREY, PLAIN, Y10, Y12, Y16, YUYV
from lab.streams import expect_sequence, split
from lab.v4l2 import names

CTL = ("v4l2-ctl", "-d", loopback.PHASMID)


def test_it_is_listed_with_its_format_and_interval(scratch):
    loopback.load()
    device = Device(scratch, GREY, loopback.PHASMID).ready()
    expect("camera in device.json", device.camera, loopback.PHASMID)
    expect("its name", names()[loopback.PHASMID], "Phasmid one")
    # Ignores the exit status, which depends on /dev/video0, a node that does not exist.
    listed = scratch.run("v4l2-ctl", "--list-devices").out
    expect_in("list of devices", "Phasmid one (platform:v4l2loopback-000):\n\t/dev/video10", listed)
    formats = scratch.run(*CTL, "--list-formats-ext").ok().out
    for part in ("'GREY'", "320x241", "(5.000 fps)"):
        expect_in("formats", part, formats)
    everything = scratch.run(*CTL, "--all").ok().out
    for part in ("Video Capture", "Pixel Format      : 'GREY'", f"Size Image        : {GREY.size}"):
        expect_in("--all", part, everything)
    device.stop()


def saved_sequence(scratch, variation):
    """A sequence, triggered over the control port, as v4l2-ctl saves it."""
    rendered = reference(scratch, variation)
    loopback.load()
    device = Device(scratch, variation, loopback.PHASMID).ready()
    expect_in("formats", f"'{variation.fourcc}'", scratch.run(*CTL, "--list-formats").ok().out)
    device.control.arm()
    saved = scratch.dir / "saved"
    reader = scratch.start(
        *CTL, "--stream-mmap=32", f"--stream-count={FRAMES + 4}", f"--stream-to={saved}", "--verbose")
    wait_until("STREAMON", lambda: "VIDIOC_STREAMON" in "".join(reader.said()))
    device.control.run_sequence()
    # Frames of the free-running camera complete the requested number.
    device.control.run_free()
    reader.wait().ok()
    expect_sequence(split(saved.read_bytes(), variation), rendered, variation)
    device.stop()


def test_it_saves_grey_as_rendered(scratch):
    saved_sequence(scratch, GREY)


@whole
def test_it_saves_frames_without_a_data_line_as_rendered(scratch):
    saved_sequence(scratch, PLAIN)


@whole
def test_it_saves_yuyv_as_rendered(scratch):
    saved_sequence(scratch, YUYV)


@whole
def test_it_saves_10_bits_as_rendered(scratch):
    saved_sequence(scratch, Y10)


@whole
def test_it_saves_12_bits_as_rendered(scratch):
    saved_sequence(scratch, Y12)


@whole
def test_it_saves_16_bits_as_rendered(scratch):
    saved_sequence(scratch, Y16)


def test_buffers_bear_the_time_of_the_exposure(scratch):
    loopback.load()
    device = Device(scratch, GREY, loopback.PHASMID, "--no-noise").ready()
    saved = scratch.dir / "saved"
    done = scratch.run(
        "v4l2-ctl", "-d", loopback.PHASMID, "--verbose", "--stream-mmap", "--stream-count=6",
        f"--stream-to={saved}").ok()
    times = [float(time) for time in re.findall(r"dqbuf:.* ts: ([0-9.]+)", done.out + done.err)]
    frames = split(saved.read_bytes(), GREY)
    expect("times of frames", len(times), len(frames))
    starts = [Line(frame, GREY).start_ns for frame in frames]
    # Excludes the first frame, whose time is the module's: it stamps waiting buffers when a reader
    # requests buffers.
    for at in range(2, len(frames)):
        between = times[at] - times[at - 1] - (starts[at] - starts[at - 1]) / 1e9
        expect_true(f"frame {at} is {between} s off", abs(between) < 5e-6)
    device.stop()
