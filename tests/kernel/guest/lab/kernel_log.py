"""The kernel's log while a test runs, and what in it is a complaint."""

import os
import re

# Level of the kernel's messages: 4 is a warning, 3 an error; lower levels are more severe.
WARNING = 4
USB = re.compile(r"(usb|hub|vhci|usbip|uvcvideo|cdc_acm|videodev|media)")
# Complaints that drivers log below the warning level.
WORDS = re.compile(
    r"cannot find a urb|unlink.*(lost|fail)|WARNING:|BUG:|Call Trace|not accepting address"
    r"|descriptor read.*error|unable to (read|enumerate)|config.*invalid|Failed to (query|set|initialize)")

# Messages about errors that the drivers or these tests cause themselves:
#
# - EPERM (-1): the driver itself has cancelled the transfer. When uvcvideo stops a stream, it
#   cancels all transfers before it waits for its workers, and a worker may still resubmit one.
# - ENODEV (-19): the device has been unplugged, but the driver has not been notified yet. Transfers
#   fail in this interval. Opening the port fails too, for example by a scan that has lost its
#   device.
# - EPIPE (-32): vhci_hcd cancels transfers over a connection that it has just shut down itself, as
#   `usbip detach` requests. If the connection is lost for another reason, a test fails because its
#   device is missing.
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
                # Each read returns one message: "level and facility,number,time,flags;text", then
                # lines of tags.
                head, _, text = os.read(self.records, 8192).decode(errors="replace").partition(";")
            except BlockingIOError:
                return
            except BrokenPipeError:
                yield 0, "BUG: of this test: the log has run over, and part of it was not read"
                continue
            priority = int(head.split(",")[0])
            if priority < 8:
                yield priority, text.split("\n")[0]
