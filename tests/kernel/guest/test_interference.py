"""Others who come and go while a scan runs, and scans that do not come to their end."""

import signal
import time

from lab import loopback
from lab.device import Device, expect_scan, reference_scan
from lab.failure import expect, expect_in, limit, whole
from lab.guest import wait_until
from lab.profiles import GREY, PLAIN


def served(scratch, variation=GREY, name="device", camera=loopback.PHASMID):
    return Device(scratch, variation, camera, "--no-noise", name=name).ready()


def look(scratch, count):
    """A viewer that comes, sees frames and leaves."""
    return scratch.run(
        "v4l2-ctl", "-d", loopback.PHASMID, "--stream-mmap", f"--stream-count={count}", seconds=30)


@whole
@limit(200)
def test_a_reader_comes_and_goes_during_a_scan(scratch):
    """It resets the module's buffers under the scan, which goes on or is repeated."""
    for variation in (GREY, PLAIN):
        wanted = reference_scan(scratch, variation, "--no-noise")
        loopback.load()
        device = served(scratch, variation, name=f"device-{variation.data_line}")
        out = f"disturbed-{variation.data_line}"
        job = device.scan(out, wait=False)
        wait_until("the scan opens the camera", lambda: job.has_open(loopback.PHASMID))
        look(scratch, 1)
        done = job.wait(90)
        if done.status == 0:
            expect_scan("a scan with a visitor", scratch.dir / out, wanted)
        else:
            expect("status", done.status, 1)
            expect_in("what it says", "two runs failed", done.err)
        device.scan(f"next-{variation.data_line}").ok()
        expect_scan("the next scan", scratch.dir / f"next-{variation.data_line}", wanted)
        device.stop()


@whole
def test_a_scan_that_fails_or_is_interrupted_leaves_the_camera_free(scratch):
    loopback.load()
    device = served(scratch)
    for end in (signal.SIGINT, signal.SIGTERM):
        job = device.scan(f"broken-{end.name}", wait=False)
        wait_until("the scan opens the camera", lambda: job.has_open(loopback.PHASMID))
        time.sleep(0.8)
        job.send(end)
        expect_in("what it says", "interrupted", job.wait(30).with_status(1).err)
        expect("source", device.control.ask("TRIG:SOUR?"), "INT")
        device.release_control()
        look(scratch, 4).ok()
    # No producer streams into the second node.
    done = device.scan("elsewhere", camera=loopback.SECOND).with_status(1)
    expect_in("what it says", loopback.SECOND, done.err)
    expect("source", device.control.ask("TRIG:SOUR?"), "INT")
    look(scratch, 4).ok()
    device.stop()
