"""The lane itself, with foreign programs only: what these find broken is not ours."""

import os

from lab import loopback
from lab.failure import expect, expect_in
from lab.guest import wait_until
from lab.v4l2 import names


def test_the_module_makes_the_nodes_with_their_names(scratch):
    loopback.load()
    # Nodes of vivid may exist too.
    for number, label in loopback.NODES:
        expect(f"name of node {number}", names().get(f"/dev/video{number}"), label)


def test_frames_of_ffmpeg_reach_v4l2_ctl(scratch):
    loopback.load()
    frame = bytes(range(256)) * 300  # 320 x 240 pixels; the rows repeat every four
    raw = scratch.dir / "in.raw"
    raw.write_bytes(frame * 60)
    scratch.start(
        "ffmpeg", "-nostdin", "-loglevel", "error", "-re", "-stream_loop", "-1",
        "-f", "rawvideo", "-pix_fmt", "gray", "-video_size", "320x240", "-framerate", "10", "-i", raw,
        "-f", "v4l2", "-pix_fmt", "gray", loopback.PHASMID,
    )
    wait_until("a stream", lambda: "GREY" in scratch.run(
        "v4l2-ctl", "-d", loopback.PHASMID, "--list-formats").out, 40)
    saved = scratch.dir / "out.raw"
    scratch.run(
        "v4l2-ctl", "-d", loopback.PHASMID, "--stream-mmap", "--stream-count=3", f"--stream-to={saved}",
    ).ok()
    expect("frames saved", saved.read_bytes() == frame * 3, True)


def test_a_module_in_use_stays(scratch):
    loopback.load()
    scratch.hold(os.open(loopback.PHASMID, os.O_RDWR))
    done = loopback.rmmod()
    expect("status of rmmod", done.returncode, 1)
    expect_in("rmmod", "in use", done.stderr)
