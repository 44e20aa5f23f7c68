"""The node goes away under its users, as when a camera is pulled out. Each test uses up a node, and
the module cannot be loaded anew after that: these tests come last, in this order."""

import errno
import os

from lab import loopback
from lab.device import Device
from lab.failure import expect, expect_in, expect_true, whole
from lab.guest import wait_until
from lab.profiles import GREY
from lab.v4l2 import names, produce

NODES = [(20, "Phasmid one"), (21, "Phasmid two"), (22, "Phasmid three"), (23, "Other")]

LOADED = []


def nodes():
    """Loads the module where no test of these has yet."""
    if not LOADED:
        loopback.load(NODES)
        LOADED.append(True)


def unplug(path):
    # The module never stays loaded: its initialisation always returns an error.
    done = loopback.insmod("/mnt/modules/unplug.ko", f"node={path}")
    expect_in("insmod", "temporarily unavailable", done.stderr)
    expect_true("the node is gone", path not in names())


def expect_gone(what, done, path):
    done.with_status(1)
    expect_in(what, path, done.err)
    expect_in(what, "gone", done.err)
    expect_true(f"{what}: no panic", "panicked" not in done.err)


@whole
def test_the_plug_is_pulled_out(scratch):
    """What the other tests stand on: a producer at work is told ENODEV."""
    nodes()
    node = scratch.hold(produce("/dev/video23", 320, 240, b"GREY"))
    frame = bytes(320 * 240)
    expect("bytes written", os.write(node, frame), len(frame))
    unplug("/dev/video23")
    try:
        os.write(node, frame)
        found = None
    except OSError as error:
        found = error.errno
    expect("errno of a write", found, errno.ENODEV)


@whole
def test_the_device_says_so_and_ends(scratch):
    nodes()
    device = Device(scratch, GREY, "/dev/video20").ready()
    unplug("/dev/video20")
    expect_gone("serve", device.job.wait(30), "/dev/video20")
    expect("run directory is there", device.run_dir.exists(), False)
    # The next device takes another node.
    again = Device(scratch, GREY, "auto", name="again").ready()
    expect("camera", again.camera, "/dev/video21")
    again.scan("scan").ok()
    again.stop()


@whole
def test_a_scan_in_progress_says_so_and_ends(scratch):
    nodes()
    device = Device(scratch, GREY, "/dev/video21").ready()
    scan = device.scan("scan", wait=False)
    wait_until("the scan opens the camera", lambda: scan.has_open("/dev/video21"))
    unplug("/dev/video21")
    done = scan.wait(60).with_status(1)
    expect_true(f"it says why: {done.err}", len(done.err.strip()) > 20)
    expect_gone("serve", device.job.wait(30), "/dev/video21")


@whole
def test_a_viewer_ends_and_the_device_too(scratch):
    nodes()
    device = Device(scratch, GREY, "/dev/video22").ready()
    viewer = scratch.start("v4l2-ctl", "-d", "/dev/video22", "--stream-mmap", "--verbose")
    wait_until("STREAMON", lambda: "VIDIOC_STREAMON" in "".join(viewer.said()))
    unplug("/dev/video22")
    expect_gone("serve", device.job.wait(30), "/dev/video22")
