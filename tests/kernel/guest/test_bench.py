"""`phasmid bench --links` over the links that only a kernel has: a node of v4l2loopback, and the USB
device as uvcvideo and cdc_acm drive it."""

import json

from lab import loopback, usb
from lab.failure import expect, expect_true, limit, whole
from lab.guest import wait_until

LINKS = ["in memory", "pty and frame socket", "pty and TCP", "USB/IP", "pty and V4L2", "USB of the kernel"]
# Bytes of a frame with its data line.
BYTES = 1138 * 490
# Three rounds of a sequence of 22 frames.
FRAMES = 3 * 22


@whole
@limit(600)
def test_speed_over_every_link(scratch):
    loopback.load()
    usb.load()
    done = scratch.phasmid("bench", "--links", "--frames", "22", "--json", seconds=570).ok()
    speeds = json.loads(done.out)
    expect("bytes of a frame", speeds["frame_bytes"], BYTES)
    expect("links", [link["link"] for link in speeds["links"]], LINKS)
    for link in speeds["links"]:
        name, found = link["link"], link["figures"]
        expect(f"{name}: what is lacking", link["lacks"], None)
        expect(f"{name}: triggers", found["triggers"], FRAMES)
        least, median, late, most = found["latency_us"]
        # No frame arrives in less time than its bytes take to copy, or after the timeout.
        ordered = speeds["copy_us"] < least <= median <= late <= most < 20e6
        expect_true(f"{name}: latencies {found['latency_us']} us", ordered)
        expect(f"{name}: frames of sequences", found["frames"], FRAMES)
        low, rate, high = found["frames_per_s"]
        expect_true(f"{name}: {low}, {rate}, {high} frames/s", 0 < low <= rate <= high < 1e6 / speeds["copy_us"])
        if name == "pty and V4L2":
            expect_true(f"{name}: {found['lost']} frames lost", 0 <= found["lost"] < FRAMES)
        else:
            expect(f"{name}: frames lost", found["lost"], 0)
    # The kernel has removed the device, and the node has no producer.
    wait_until("the camera is gone", lambda: usb.video_node() is None)
    loopback.unload()
