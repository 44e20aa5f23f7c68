"""`phasmid study speed` over the links that only a kernel has: a node of v4l2loopback, and the USB
device as uvcvideo and cdc_acm drive it."""

import csv

from lab import loopback, usb
from lab.failure import expect, expect_in, expect_true, limit, whole
from lab.guest import wait_until

LINKS = ["in memory", "pty and frame socket", "pty and TCP", "USB/IP", "pty and V4L2", "USB of the kernel"]
# Bytes of a frame in the quick form, with its data line.
BYTES = 380 * 161
TRIGGERS, SEQUENCES = 44, 5 * 22


def rows_of(rows, group):
    found = {row["name"]: row for row in rows if row["group"] == group}
    expect(f"links of {group}", sorted(found), sorted(LINKS))
    for name, row in found.items():
        expect(f"{group}, {name}: what is wrong", (row["state"], row["note"]), ("", ""))
        expect(f"{group}, {name}: bytes", int(row["bytes"]), BYTES)
    return found


@whole
@limit(600)
def test_speed_over_every_link(scratch):
    loopback.load()
    usb.load()
    out = scratch.dir / "speed"
    scratch.phasmid(
        "study", "speed", "--quick", "--only", "link", "--out", out, seconds=570).ok()
    with open(out / "rows.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for name, row in rows_of(rows, "latency").items():
        expect(f"{name}: frames one by one", int(row["frames"]), TRIGGERS)
        least, median, p99, most = (float(row[f"{key}_us"]) for key in ("least", "median", "p99", "most"))
        # No frame arrives in less time than its bytes take to copy, or after the timeout.
        ordered = float(row["copy_us"]) < least <= median <= p99 <= most < 20e6
        expect_true(f"{name}: latencies {least}, {median}, {p99}, {most} us", ordered)
    for name, row in rows_of(rows, "throughput").items():
        expect(f"{name}: frames of sequences", int(row["frames"]), SEQUENCES)
        rates = [float(row[key]) for key in ("rate_low", "rate", "rate_high")]
        expect_true(f"{name}: {rates} frames/s", 0 < rates[0] <= rates[1] <= rates[2] < 1e6 / float(row["copy_us"]))
        lost = int(row["lost"])
        if name == "pty and V4L2":
            expect_true(f"{name}: {lost} frames lost", 0 <= lost < SEQUENCES)
        else:
            expect(f"{name}: frames lost", lost, 0)
    tables = (out / "tables.md").read_text()
    for name in LINKS:
        expect_in("tables.md", f"| {name} ", tables)
    # The kernel has removed the device, and the node has no producer.
    wait_until("the camera is gone", lambda: usb.video_node() is None)
    loopback.unload()
