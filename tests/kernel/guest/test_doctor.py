"""`phasmid doctor` on a machine with a kernel of its own."""

import fcntl
import json
import os
import struct

from lab import loopback, udev, v4l2
from lab.failure import expect, expect_in
from lab.guest import wait_until

NODES = [(10, "Phasmid 1"), (11, "Other")]


def report(scratch, *arguments, status=0, user=None):
    """The report's checks by topic, and which features work."""
    done = scratch.phasmid("doctor", "--json", *arguments, user=user).with_status(status)
    found = json.loads(done.out)
    topics = {}
    for check in found["checks"]:
        topics.setdefault(check["topic"], []).append(check)
    return topics, found["features"]


def test_without_the_module(scratch):
    loopback.unload()
    topics, features = report(scratch)
    expect("module", topics["v4l2loopback"][0]["status"], "missing")
    expect("features", (features["embedded"], features["v4l2"]), (True, False))
    report(scratch, "--need", "v4l2", status=1)


def test_all_is_well(scratch):
    with udev.running(scratch):
        loopback.load(NODES)
        wait_until("a name", lambda: udev.links() == {"1": "/dev/video10"})
        topics, _ = report(scratch, "--need", "v4l2")
    for topic in ("v4l2loopback", "camera", "permission", "stable names", "udev rules"):
        expect(topic, [check["status"] for check in topics[topic]], ["ok"])
    expect_in("camera", '/dev/video10 "Phasmid 1": free', topics["camera"][0]["found"])


def test_bad_options(scratch):
    loopback.load(NODES, exclusive_caps=0, max_buffers=4)
    topics, _ = report(scratch, "--need", "v4l2")
    expect("module", topics["v4l2loopback"][0]["status"], "note")
    expect_in("module", "max_buffers=4", topics["v4l2loopback"][0]["found"])
    expect("camera", topics["camera"][0]["status"], "note")
    expect_in("camera", "exclusive_caps=0", topics["camera"][0]["found"])


def test_a_ring_that_a_reader_has_shrunk(scratch):
    loopback.load(NODES)
    producer = v4l2.produce(loopback.PHASMID, 64, 48, b"GREY")
    reader = os.open(loopback.PHASMID, os.O_RDWR)
    # VIDIOC_REQBUFS: 3 mapped buffers for capture.
    fcntl.ioctl(reader, 0xC0145608, struct.pack("<5I", 3, 1, 1, 0, 0))
    os.close(reader)
    os.close(producer)
    topics, _ = report(scratch)
    expect_in("camera", "3 of 32 buffers", topics["camera"][0]["found"])
    expect_in("camera", "modprobe -r v4l2loopback", topics["camera"][0]["fix"])


def test_a_user_who_may_not(scratch):
    with udev.running(scratch):
        loopback.load(NODES)
        wait_until("group video", lambda: os.stat(loopback.PHASMID).st_mode & 0o777 == 0o660)
        topics, _ = report(scratch, "--need", "v4l2", status=1, user=65534)
    expect("permission", topics["permission"][0]["status"], "missing")
    expect_in("permission", "usermod -aG video nobody", topics["permission"][0]["fix"])
