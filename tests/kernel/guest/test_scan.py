"""`phasmid scan` over the node: the frames, maps and points of a scan over the frame socket."""

from lab import loopback
from lab.device import Device, expect_scan, reference_scan
from lab.failure import expect_in, whole
from lab.profiles import GREY, PLAIN, Y12, YUYV


def scanned(scratch, variation, capture):
    wanted = reference_scan(scratch, variation)
    loopback.load()
    device = Device(scratch, variation, loopback.PHASMID).ready()
    device.scan("scan", "--capture", capture).ok()
    expect_scan("scan over V4L2", scratch.dir / "scan", wanted)
    device.stop()


def test_v4l_path_reads_grey(scratch):
    scanned(scratch, GREY, "v4l")


@whole
def test_v4l_path_reads_frames_without_a_data_line(scratch):
    scanned(scratch, PLAIN, "v4l")


@whole
def test_v4l_path_reads_12_bits(scratch):
    scanned(scratch, Y12, "v4l")


@whole
def test_v4l_path_reads_yuyv(scratch):
    scanned(scratch, YUYV, "v4l")


def test_nokhwa_path_reads_yuyv(scratch):
    scanned(scratch, YUYV, "nokhwa")


@whole
def test_the_path_is_chosen_by_what_the_node_offers(scratch):
    for variation in (GREY, YUYV):
        loopback.load()
        device = Device(scratch, variation, loopback.PHASMID).ready()
        out = f"scan-{variation.fourcc}"
        device.scan(out).ok()
        expect_scan(variation.fourcc, scratch.dir / out, reference_scan(scratch, variation))
        device.stop()


def test_camera_info_describes_the_node(scratch):
    loopback.load()
    device = Device(scratch, GREY, loopback.PHASMID).ready()
    said = scratch.phasmid("camera", "info", loopback.PHASMID).ok().out
    for part in ("v4l2 loopback", "Phasmid one", "GREY", "320", "241"):
        expect_in("camera info", part, said)
    device.stop()


def test_auto_takes_the_free_labelled_node(scratch):
    loopback.load()
    first = Device(scratch, GREY, "auto", name="first").ready()
    second = Device(scratch, GREY, "auto", name="second").ready()
    third = Device(scratch, GREY, "auto", name="third").ready()
    expect_in("first", "/dev/video10", first.camera)
    expect_in("second", "/dev/video11", second.camera)
    # The third node's label does not begin with Phasmid.
    expect_in("third", "socket:", third.camera)
    another = "another phasmid serves its camera there"
    for device, reason in (
        (first, '"Phasmid one", the first free node labelled Phasmid)'),
        (second, f'"Phasmid two", the first free node labelled Phasmid; /dev/video10: {another})'),
        (third, f"/dev/video11: {another}"),
    ):
        expect_in("why this camera", reason, device.job.said()[0])
    for device in (third, second, first):
        device.stop()
