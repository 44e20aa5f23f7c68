"""What goes wrong on real desks: after each of it the next scan is right, or an error says why.

The devices here have no noise, so that every sequence has the same bytes."""

import os
import signal
import time

from lab import loopback, vivid
from lab.device import Device, expect_scan, reference_scan
from lab.failure import expect, expect_in, expect_true, limit, whole
from lab.guest import wait_until
from lab.profiles import FRAMES, GREY, PLAIN
from lab.streams import expect_free_run, split
from lab.v4l2 import produce

NOBODY = 65534


def served(scratch, variation=GREY, camera=loopback.PHASMID, name="device"):
    return Device(scratch, variation, camera, "--no-noise", name=name).ready()


def loaded_and_served(scratch, variation=GREY):
    loopback.load()
    return served(scratch, variation)


def expect_next_scan_right(device, out="next"):
    device.scan(out).ok()
    wanted = reference_scan(device.scratch, device.variation, "--no-noise")
    expect_scan("next scan", device.scratch.dir / out, wanted)


def reader(scratch, *options):
    """v4l2-ctl, streaming until it is ended."""
    job = scratch.start(
        "v4l2-ctl", "-d", loopback.PHASMID, "--verbose", "--stream-mmap", *options)
    wait_until("STREAMON", lambda: "VIDIOC_STREAMON" in "".join(job.said()))
    return job


def in_the_middle(scan, path=loopback.PHASMID):
    """Waits until a scan has begun. Not by the control port, which is the scan's own."""
    wait_until("the scan opens the camera", lambda: scan.has_open(path))
    # The trigger follows at once and a sequence takes 1.8 s, so this ends in its middle.
    time.sleep(0.8)


def refused(scratch, *options, status=1, user=None, camera=loopback.PHASMID):
    """Standard error of a `serve` that cannot."""
    device = Device(scratch, GREY, camera, *options, name=f"refused-{scratch.count}", user=user)
    done = device.job.wait(30).with_status(status)
    expect("lines that it says", len(done.err.strip().splitlines()), 1)
    return done.err


@whole
def test_the_reader_leaves_and_returns(scratch):
    device = loaded_and_served(scratch)
    for _ in range(3):
        saved = scratch.dir / "saved"
        scratch.run(
            "v4l2-ctl", "-d", loopback.PHASMID, "--stream-mmap", "--stream-count=4",
            f"--stream-to={saved}").ok()
        expect_free_run(split(saved.read_bytes(), GREY), GREY, 4)
    expect_next_scan_right(device, "first")
    expect_next_scan_right(device, "second")
    device.stop()


@whole
def test_a_reader_that_dies(scratch):
    device = loaded_and_served(scratch)
    dead = reader(scratch)
    dead.send(signal.SIGKILL)
    dead.process.wait()
    expect_next_scan_right(device)
    device.stop()


def test_two_readers(scratch):
    device = loaded_and_served(scratch)
    other = reader(scratch)
    expect_next_scan_right(device)
    expect_true("the other reader goes on", other.running())
    device.stop()


@whole
def test_a_slow_reader(scratch):
    """A stopped reader does not hold up the device, nor another reader."""
    device = loaded_and_served(scratch)
    slow = reader(scratch, "--stream-count=1000")
    slow.send(signal.SIGSTOP)
    expect_next_scan_right(device)
    slow.send(signal.SIGCONT)
    device.stop()


@whole
def test_a_slow_scan(scratch):
    """A scan that is stopped in its middle is right, repeated where it has to be, or says why not."""
    for variation in (GREY, PLAIN):
        wanted = reference_scan(scratch, variation, "--no-noise")
        device = loaded_and_served(scratch, variation)
        # Sets a ring of two buffers, in which a stopped scan loses frames.
        small = reader(scratch, "--stream-mmap=2")
        out = f"slow-{variation.data_line}"
        job = device.scan(out, wait=False)
        in_the_middle(job)
        job.send(signal.SIGSTOP)
        time.sleep(1.2)
        job.send(signal.SIGCONT)
        done = job.wait(90)
        if done.status == 0:
            expect_scan("a scan that took its time", scratch.dir / out, wanted)
        else:
            expect("status", done.status, 1)
            expect_true(f"it says why: {done.err}", len(done.err.strip()) > 20)
        small.end()
        expect_next_scan_right(device, f"next-{variation.data_line}")
        device.stop()


@whole
@limit(150)
def test_serve_killed_and_started_again(scratch):
    device = loaded_and_served(scratch)
    held = reader(scratch)
    job = device.scan("broken", wait=False)
    in_the_middle(job)
    device.kill()
    done = job.wait(60).with_status(1)
    expect_true(f"it says why: {done.err}", len(done.err.strip()) > 20)
    expect_true("no panic", "panicked" not in done.err)
    # The reader keeps the node and its format after the producer's death.
    again = served(scratch)
    expect_next_scan_right(again)
    held.end()
    expect_next_scan_right(again, "without-the-reader")
    again.stop()


@whole
def test_a_foreign_producer_holds_the_node(scratch):
    loopback.load()
    foreign = scratch.hold(produce(loopback.PHASMID, 640, 480, b"GREY"))
    os.write(foreign, bytes(640 * 480))
    said = refused(scratch)
    expect_in("serve", "/dev/video10", said)
    expect_in("serve", "another program streams into it", said)
    # With `auto`, the device takes the next free node.
    device = served(scratch, camera="auto", name="auto")
    expect("camera", device.camera, loopback.SECOND)
    expect_in("serve", "labelled Phasmid; /dev/video10: another program streams into it", device.job.said()[0])
    expect_next_scan_right(device)
    device.stop()
    # After a program has written to a node, the module no longer offers the node for output until
    # it is reloaded.
    scratch.let_go(foreign)
    expect_in("serve after it", "sudo modprobe -r v4l2loopback", refused(scratch))
    after = loaded_and_served(scratch)
    expect_next_scan_right(after, "after")
    after.stop()


@whole
def test_two_devices_share_no_node(scratch):
    device = loaded_and_served(scratch)
    expect_in("serve", "/dev/video10: another phasmid serves its camera there", refused(scratch))
    expect_next_scan_right(device)
    device.stop()


@whole
def test_no_permission(scratch):
    loopback.load()
    os.chmod(loopback.PHASMID, 0o660)
    os.chown(loopback.PHASMID, 0, 0)
    said = refused(scratch, user=NOBODY)
    for part in ("/dev/video10", "ermission", "video"):
        expect_in("serve", part, said)
    device = served(scratch)
    done = scratch.phasmid("camera", "info", loopback.PHASMID, user=NOBODY).with_status(1)
    for part in ("/dev/video10", "ermission", "video"):
        expect_in("camera info", part, done.err)
    expect_next_scan_right(device)
    device.stop()


def test_a_node_that_is_no_loopback(scratch):
    said = refused(scratch, camera=vivid.load(), status=2)
    expect_in("serve", "vivid", said)
    expect_in("serve", "loopback", said)


def test_a_path_that_is_no_camera(scratch):
    for path in ("/dev/null", "/dev/video99"):
        for done in (
            scratch.phasmid("camera", "info", path),
            Device(scratch, GREY, path, name=f"none-{scratch.count}").job.wait(30),
        ):
            expect_true(f"{done.command}: status 1 or 2, not {done.status}", done.status in (1, 2))
            expect_in(done.command, path, done.err)


@whole
def test_nobody_streams_into_the_node(scratch):
    loopback.load()
    device = served(scratch, camera="socket")
    done = device.scan("silent", timeout=3, camera=loopback.PHASMID)
    expect_in("scan", "/dev/video10", done.with_status(1).err)
    device.stop()


def test_the_fast_clock_is_refused(scratch):
    loopback.load()
    said = refused(scratch, "--clock", "fast", status=2)
    expect_in("serve", "--clock", said)


@whole
def test_a_module_in_use_is_not_removed(scratch):
    device = loaded_and_served(scratch)
    done = loopback.rmmod()
    expect("status of rmmod", done.returncode, 1)
    expect_in("rmmod", "in use", done.stderr)
    expect_next_scan_right(device)
    device.stop()


@whole
def test_a_module_with_two_buffers(scratch):
    """The module's default. A scan is right, or says what it lost."""
    loopback.load(max_buffers=2)
    device = served(scratch)
    done = device.scan("scan")
    if done.status == 0:
        wanted = reference_scan(scratch, GREY, "--no-noise")
        expect_scan("scan", scratch.dir / "scan", wanted)
    else:
        expect_in("scan", f"of {FRAMES}", done.with_status(1).err)
    device.stop()


@whole
def test_a_module_without_exclusive_caps(scratch):
    loopback.load(exclusive_caps=0)
    device = served(scratch)
    expect_next_scan_right(device)
    device.stop()
