"""v4l2-compliance, and the failures that are v4l2loopback's and uvcvideo's own."""

import re

from .failure import expect

# Tests that v4l2loopback 0.12.7 fails with any producer, and the reasons. All other tests must
# pass.
MODULES_OWN = {
    "unlimited opens": "the module takes 10 openers of a node (max_openers)",
    "VIDIOC_ENUM_FMT/FRAMESIZES/FRAMEINTERVALS":
        "the module answers for its output side on a node that announces capture only",
    "VIDIOC_G/S_PARM": "the module lists intervals, but does not set V4L2_CAP_TIMEPERFRAME",
    "VIDIOC_G_FMT": "as VIDIOC_ENUM_FMT: the output side answers",
    "VIDIOC_REQBUFS/CREATE_BUFS/QUERYBUF": "the module's buffers bear no flag of a clock",
}
# Additional failures when the test streams.
MODULES_OWN_STREAMING = MODULES_OWN | {
    "blocking wait": "the module's DQBUF gives a frame although no buffer is queued",
    "MMAP (no poll)": "the module takes STREAMON without any buffers",
    "MMAP (select)": "as MMAP (no poll)",
    "MMAP (epoll)": "as MMAP (no poll)",
}

# Streaming tests that the uvcvideo driver of Linux 6.1 fails with any camera. A file handle that
# has freed its buffers no longer owns the stream; the driver then answers STREAMON with EBUSY, but
# the tests expect EINVAL. The remainder of these tests does not run; the USERPTR test does stream.
NOT_EINVAL = "node->streamon(q.g_type()) != EINVAL"
DRIVERS_OWN_STREAMING = {
    "MMAP (no poll)": NOT_EINVAL,
    "MMAP (select)": NOT_EINVAL,
    "MMAP (epoll)": NOT_EINVAL,
}


def failures(text):
    """Names of the tests that v4l2-compliance says have failed."""
    failed = re.findall(r"^\s*test (?:for )?(.*): FAIL$", text, re.MULTILINE)
    tests = re.findall(r"^\s*test (?:for )?(.*): (?:OK|FAIL)", text, re.MULTILINE)
    expect("tests in the report, at least 40", len(tests) >= 40, True)
    return set(failed)


def reasons(text):
    """What v4l2-compliance found untrue where it failed, without places in its source."""
    return set(re.findall(r"^\s*fail: \S+\(\d+\): (.*)$", text, re.MULTILINE))


def expect_no_other_failure(what, text, known):
    found = failures(text)
    expect(f"{what}: failures that are new", sorted(found - set(known)), [])
    expect(f"{what}: failures that are listed and are none", sorted(set(known) - found), [])
