"""The kernel's log while a test runs, and what in it is a complaint."""

import os
import re

# Levels of the kernel's messages: 4 is a warning, 3 an error, lower is worse.
WARNING = 4
USB = re.compile(r"(usb|hub|vhci|usbip|uvcvideo|cdc_acm|videodev|media)")
# Words of complaints that drivers write at a level of mere information.
WORDS = re.compile(
    r"cannot find a urb|unlink.*(lost|fail)|WARNING:|BUG:|Call Trace|not accepting address"
    r"|descriptor read.*error|unable to (read|enumerate)|config.*invalid|Failed to (query|set|initialize)")

# What drivers complain of in their own doing, or in ours. EPERM is no answer of a device: it is what
# a transfer gets that the driver itself has withdrawn. As it stops a stream, uvcvideo withdraws all
# transfers first and only then waits for its workers, one of which may still hand one back. ENODEV
# is what a transfer gets in the moment between a device's unplugging and the driver's hearing of it;
# a program that opens the port again then, as a scan does that has lost its device, is told so too.
# EPIPE is what vhci_hcd gets that withdraws transfers over a connection it has itself just shut down,
# as `usbip detach` bids it; where the connection is lost otherwise, a test fails by its device's absence.
NO_COMPLAINT = re.compile(
    r"(uvcvideo [-0-9.:]+: Failed to resubmit video URB \(-(1|19)\)\."
    r"|cdc_acm [-0-9.:]+: acm_\w+ - usb_submit_urb(\(write bulk\))? failed: -(1|19)"
    r"|cdc_acm [-0-9.:]+: acm_port_activate - usb_submit_urb\(ctrl irq\) failed"
    r"|vhci_hcd: sendmsg failed!, ret=-32 for \d+)$")


class KernelLog:
    """What the kernel logs from now on."""

    def __init__(self):
        self.records = os.open("/dev/kmsg", os.O_RDONLY | os.O_NONBLOCK)
        os.lseek(self.records, 0, os.SEEK_END)

    def close(self):
        os.close(self.records)

    def complaints(self, keep):
        """Complaints in what was logged since this was last asked. All of it is written to `keep`."""
        found = []
        for level, text in self.lines():
            keep.write(f"<{level}> {text}\n")
            if NO_COMPLAINT.match(text):
                continue
            if WORDS.search(text) or (level <= WARNING and USB.match(text)):
                found.append(text)
        return found

    def lines(self):
        """Level and text of each message of the kernel itself; daemons may log here too."""
        while True:
            try:
                # One message a read: "level and facility,number,time,flags;text", then lines of tags.
                head, _, text = os.read(self.records, 8192).decode(errors="replace").partition(";")
            except BlockingIOError:
                return
            except BrokenPipeError:
                yield 0, "BUG: of this test: the log has run over, and part of it was not read"
                continue
            priority = int(head.split(",")[0])
            if priority < 8:
                yield priority, text.split("\n")[0]
