"""A camera that is not ours: the kernel's vivid, which shows a test picture."""

from lab import loopback, vivid
from lab.device import Device, reference_scan
from lab.failure import expect_in, expect_true, whole
from lab.profiles import GREY


def test_camera_info_describes_it(scratch):
    said = scratch.phasmid("camera", "info", vivid.load()).ok().out
    for part in (
            "vivid", "YUYV", "Brightness",
            "Bitmask (bit mask) = 0x80002000, of 0x80402010", "Integer 64 Bits (64-bit integer) = 0",
            "String (string) = \""):
        expect_in("camera info", part, said)


def expect_no_surface(scratch, done, out):
    expect_in("what it says", "no modulation", done.with_status(1).err)
    expect_true("there is no cloud", not (scratch.dir / out / "cloud.ply").exists())


@whole
def test_a_scan_without_a_port_says_no_modulation(scratch):
    node = vivid.load()
    # The manifest of a sequence that a projector would have shown.
    manifest = scratch.dir / "sequence.toml"
    manifest.write_bytes(reference_scan(scratch, GREY)["sequence.toml"])
    for capture in ("v4l", "nokhwa"):
        out = f"scan-{capture}"
        done = scratch.phasmid(
            "scan", "--camera", node, "--manifest", manifest, "--capture", capture,
            "--timeout", "20", "--out", scratch.dir / out)
        expect_no_surface(scratch, done, out)


@whole
def test_a_scan_with_another_devices_port_makes_no_surface(scratch):
    node = vivid.load()
    loopback.load()
    device = Device(scratch, GREY, "socket").ready()
    done = device.scan("scan", camera=node)
    expect_true(f"status 1, not {done.status}", done.status == 1)
    expect_true(f"it says why: {done.err}", len(done.err.strip()) > 20)
    expect_true("there is no cloud", not (scratch.dir / "scan/cloud.ply").exists())
    device.stop()
