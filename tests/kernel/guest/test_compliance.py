"""v4l2-compliance on the capture side: whoever produces, nothing fails but what the module itself
fails."""

import os
import threading

from lab import loopback
from lab.compliance import MODULES_OWN, MODULES_OWN_STREAMING, expect_no_other_failure
from lab.device import Device
from lab.profiles import GREY
from lab.v4l2 import produce


def report(scratch, *options):
    # Ignores the exit status, which is nonzero because of the module's own failures.
    return scratch.run("v4l2-compliance", "-d", loopback.PHASMID, *options).out


def test_the_module_fails_what_is_listed(scratch):
    """Under a producer of ten lines: what fails here is nothing that `phasmid serve` could mend."""
    loopback.load()
    node = produce(loopback.PHASMID, 320, 241, b"GREY")
    # The node becomes a capture node with the first frame.
    os.write(node, bytes(320 * 241))
    over = threading.Event()

    def stream():
        while not over.wait(0.2):
            os.write(node, bytes(320 * 241))

    producer = threading.Thread(target=stream)
    producer.start()
    try:
        expect_no_other_failure("without streaming", report(scratch), MODULES_OWN)
        expect_no_other_failure("with streaming", report(scratch, "-s"), MODULES_OWN_STREAMING)
    finally:
        over.set()
        producer.join()
        os.close(node)


def test_the_served_camera_fails_no_more(scratch):
    loopback.load()
    device = Device(scratch, GREY, loopback.PHASMID).ready()
    expect_no_other_failure("without streaming", report(scratch), MODULES_OWN)
    expect_no_other_failure("with streaming", report(scratch, "-s"), MODULES_OWN_STREAMING)
    device.stop()
