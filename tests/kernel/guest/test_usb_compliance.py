"""v4l2-compliance on the camera as uvcvideo drives it: nothing fails but what the driver itself fails."""

import re

from lab.compliance import DRIVERS_OWN_STREAMING, expect_no_other_failure, reasons
from lab.failure import expect, expect_in, whole
from lab.profiles import GREY, Y12, YUYV
from lab.usb import UsbVariation, plugged


def complies(scratch, variation, *enumerates):
    """`enumerates` is what `lsusb -v` says where the device is of the kind that is meant."""
    device = plugged(scratch, variation)
    said = scratch.run("lsusb", "-v", "-d", "1209:0001").ok().out
    for part in enumerates:
        expect_in("lsusb -v", part, said)
    said = scratch.run("v4l2-ctl", "-d", device.node, "--get-fmt-video").ok().out
    expect_in("format", f"'{variation.fourcc}'", said)
    for options, known in (([], {}), (["-s", "5"], DRIVERS_OWN_STREAMING)):
        said = scratch.run("v4l2-compliance", "-d", device.node, *options).out
        expect_no_other_failure(f"v4l2-compliance {options}", said, known)
        expect("reasons of failures", reasons(said), set(known.values()))
        total = re.search(r"^Total for uvcvideo device .*: \d+, Succeeded: \d+, Failed: (\d+),", said, re.MULTILINE)
        expect("failures in total", total and int(total[1]), len(known))
    for test in ("blocking wait", "USERPTR (no poll)", "USERPTR (select)"):
        expect_in("streaming", f"test {test}: OK", said)
    device.stop()


BULK, ISOCHRONOUS = "Transfer Type            Bulk", "Transfer Type            Isochronous"
HIGH, SUPER = "bcdUSB               2.00", "bcdUSB               3."


def test_grey(scratch):
    complies(scratch, GREY, BULK, HIGH)


@whole
def test_16_bits(scratch):
    complies(scratch, Y12, BULK, HIGH)


@whole
def test_yuyv(scratch):
    complies(scratch, YUYV, BULK, HIGH)


@whole
def test_isochronous(scratch):
    complies(scratch, UsbVariation(GREY, 'transfer = "isochronous"'), ISOCHRONOUS, HIGH)


@whole
def test_super_speed(scratch):
    complies(scratch, UsbVariation(GREY, 'speed = "super"'), BULK, SUPER)


@whole
def test_super_speed_isochronous(scratch):
    complies(scratch, UsbVariation(GREY, 'speed = "super"\ntransfer = "isochronous"'), ISOCHRONOUS, SUPER)
