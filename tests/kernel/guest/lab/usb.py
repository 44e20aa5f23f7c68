"""The device as a USB device of this kernel."""

import contextlib
import pathlib
import re

from .device import Device
from .failure import Failure, expect
from .guest import PHASMID, wait_until
from .loopback import insmod_all
from .profiles import replace

VHCI = pathlib.Path("/sys/devices/platform/vhci_hcd.0")


def load():
    insmod_all("/mnt/modules/usb-order", {})


class UsbVariation:
    """A profile with a `[usb]` table and perhaps another interval."""

    def __init__(self, variation, usb="", interval_us=None):
        self.base, self.usb, self.interval_us = variation, usb, interval_us

    def __getattr__(self, name):
        return getattr(self.base, name)

    def write(self, folder):
        text = self.base.text()
        if self.interval_us:
            text = replace(text, "frame_interval_us = 200000.0", f"frame_interval_us = {self.interval_us}")
        if self.usb:
            text = replace(text, "[[sequence]]", f"[usb]\n{self.usb}\n\n[[sequence]]")
        path = folder / "profile.toml"
        path.write_text(text)
        return path


class UsbDevice(Device):
    """`phasmid serve --usb`."""

    def __init__(self, scratch, variation, *options, how="attach", **named):
        load()
        super().__init__(scratch, variation, "socket", "--usb", how, *options, **named)

    def plugged(self, seconds=30):
        """Waits until both drivers have their nodes: camera and port."""
        self.node = wait_until("a camera of uvcvideo", video_node, seconds)
        self.port = wait_until("a port of cdc_acm", serial_node, seconds)
        return self

    def stop(self):
        """As any device; and the kernel has to be rid of it."""
        done = super().stop()
        wait_until("the camera is gone", lambda: video_node() is None)
        return done

    def scan_usb(self, out, wait=True):
        job = self.scratch.start(
            PHASMID, "scan", "--camera", self.node, "--control", self.port,
            "--timeout", "20", "--json", "--out", self.scratch.dir / out)
        return job.wait(90) if wait else job

    def resources(self):
        """Descriptors and resident kilobytes of the serving process."""
        process = pathlib.Path(f"/proc/{self.job.process.pid}")
        resident = re.search(r"VmRSS:\s+(\d+)", (process / "status").read_text())
        return len(list((process / "fd").iterdir())), int(resident[1])


def plugged(scratch, variation, *options):
    """A device that has attached itself and tells of the nodes that it has got."""
    device = UsbDevice(scratch, variation, *options).ready()
    told = device.camera, device.endpoints.get("control_usb")
    device.plugged()
    expect("nodes that the device tells of", told, (device.node, device.port))
    return device


def nodes_under_vhci(kind, name):
    """Device nodes of a class whose device hangs on the virtual controller."""
    found = []
    for node in sorted(pathlib.Path(f"/sys/class/{kind}").glob(name)):
        with contextlib.suppress(FileNotFoundError):
            if "vhci_hcd" in str(node.resolve()):
                found.append(node)
    return found


def video_node():
    for node in nodes_under_vhci("video4linux", "video*"):
        # Index 0 is the camera, index 1 its metadata. A node may disappear while it is read;
        # reading then fails because the file or the device does not exist.
        with contextlib.suppress(OSError):
            if (node / "index").read_text().strip() == "0":
                return f"/dev/{node.name}"
    return None


def serial_node():
    nodes = nodes_under_vhci("tty", "ttyACM*")
    return f"/dev/{nodes[0].name}" if nodes else None


def used_port():
    """Number of the controller's port that something is attached to."""
    for line in (VHCI / "status").read_text().splitlines()[1:]:
        words = line.split()
        if words[2] == "006":
            return int(words[1])
    return None


def pull():
    """Unplugs the device, from the kernel's side."""
    port = used_port()
    if port is None:
        raise Failure("nothing is attached")
    (VHCI / "detach").write_text(str(port))
    wait_until("the port is free", lambda: used_port() is None)
    wait_until("the camera is gone", lambda: video_node() is None)


def plug(scratch, bus_id="1-1"):
    """Attaches the device as a user does, with Debian's usbip."""
    scratch.run("usbip", "attach", "-r", "127.0.0.1", "-b", bus_id).ok()
