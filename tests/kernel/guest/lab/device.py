"""A served device, and what its frames have to be."""

import json
import os
import re
import select
import signal
import socket
import struct
import termios
import tty

from .failure import Failure, expect, expect_true
from .guest import PHASMID, wait_until
from .profiles import FRAMES, GREY, SCENE

HEADER_LEN = 72


class Control:
    """The control port, as a serial terminal has it."""

    def __init__(self, path):
        self.fd = os.open(path, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self.fd, termios.TCSANOW)

    def tell(self, line):
        os.write(self.fd, line.encode() + b"\n")

    def ask(self, line):
        self.tell(line)
        answer = b""
        while not answer.endswith(b"\n"):
            answer += self.some(line)
        return answer.decode().strip()

    def block(self, line):
        """Asks for what is answered as a block: #, a digit, that many digits of the length, text."""
        self.tell(line)
        digits = self.exactly(2, line)
        expect(f"{line}: the answer begins with", digits[:1], b"#")
        length = int(self.exactly(int(digits[1:]), line))
        return self.exactly(length + 1, line)[:-1].decode()

    def exactly(self, count, line):
        answer = b""
        while len(answer) < count:
            answer += self.some(line, count - len(answer))
        return answer

    def some(self, line, most=4096, seconds=20):
        """Bytes of an answer, at least one."""
        if not select.select([self.fd], [], [], seconds)[0]:
            raise Failure(f"{line}: no answer within {seconds} s")
        return os.read(self.fd, most)

    def order(self, line):
        """Tells, and asks whether there was an error."""
        answer = self.ask(f"{line};:SYST:ERR?")
        if answer != '0,"No error"':
            raise Failure(f"{line}: {answer}")

    def arm(self):
        """Ends free running, and waits for a trigger. *CLS, because errors outlive clients."""
        self.order("*CLS;:INIT:CONT OFF;:ABOR;:TRIG:SOUR BUS;MODE SEQ;:INIT")

    def run_sequence(self):
        self.order("*TRG")
        expect("the sequence is over", self.ask("*OPC?"), "1")

    def run_free(self):
        self.order("ABOR;:TRIG:SOUR INT")

    def close(self):
        os.close(self.fd)


class Device:
    """`phasmid serve`, started."""

    def __init__(self, scratch, variation, camera, *options, seed=7, name="device", user=None):
        self.scratch, self.variation = scratch, variation
        self.run_dir = scratch.dir / name
        self.job = scratch.start(
            PHASMID, "serve", "--profile", variation.write(scratch.dir), "--scene", SCENE,
            "--seed", seed, "--camera", camera, "--run-dir", self.run_dir, *options,
            name=f"serve-{name}", user=user,
        )
        self.control_port = None

    def ready(self):
        """Waits until it serves."""
        path = self.run_dir / "device.json"

        def announced():
            if not self.job.running():
                self.job.wait().with_status(None)
            # A killed device leaves its device.json behind, which has another process id.
            return path.exists() and json.loads(path.read_text())["pid"] == self.job.process.pid

        wait_until("device.json", announced, 30)
        self.endpoints = json.loads(path.read_text())
        self.camera = self.endpoints["camera"]
        return self

    @property
    def control(self):
        if self.control_port is None:
            self.control_port = Control(self.endpoints["control"])
        return self.control_port

    def release_control(self):
        if self.control_port is not None:
            self.control_port.close()
            self.control_port = None

    def scan(self, out, *options, camera=None, timeout=20, seconds=90, wait=True):
        """`phasmid scan` into a folder of the scratch folder; the program, ended unless not waited for."""
        self.release_control()
        job = self.scratch.start(
            PHASMID, "scan", "--camera", camera or self.camera, "--control", self.endpoints["control"],
            "--timeout", timeout, "--json", "--out", self.scratch.dir / out, *options,
        )
        return job.wait(seconds) if wait else job

    def stop(self):
        """TERM, as a service manager sends it; it has to end well and clean up."""
        self.release_control()
        self.job.send(signal.SIGTERM)
        done = self.job.wait(20).ok()
        expect("run directory is gone", self.run_dir.exists(), False)
        return done

    def kill(self):
        self.release_control()
        self.job.send(signal.SIGKILL)
        self.job.process.wait()


def receive(stream, length):
    data = bytearray()
    while len(data) < length:
        part = stream.recv(length - len(data))
        if not part:
            raise Failure("the frame socket is closed")
        data += part
    return bytes(data)


class FrameSocket:
    """Frames over the frame socket."""

    def __init__(self, device):
        self.stream = socket.socket(socket.AF_UNIX)
        self.stream.settimeout(20)
        self.stream.connect(device.endpoints["camera_socket"].removeprefix("socket:"))

    def frame(self):
        header = receive(self.stream, HEADER_LEN)
        return receive(self.stream, struct.unpack_from("<Q", header, 48)[0])

    def close(self):
        self.stream.close()


REFERENCE = {}


def reference(scratch, variation, *options):
    """Frames of a sequence as rendered: those of a device of the same seed that has only its frame
    socket. Images, without the data line."""
    key = (variation, options)
    if key not in REFERENCE:
        device = Device(scratch, variation, "socket", *options, name="reference").ready()
        device.control.arm()
        frames = FrameSocket(device)
        device.control.tell("*TRG")
        REFERENCE[key] = [variation.image(frames.frame()) for _ in range(FRAMES)]
        frames.close()
        device.stop()
    return REFERENCE[key]


SCANS = {}
# Minimum number of points of a scan of the scene. A scan with fewer cannot serve as a reference.
LEAST_POINTS = 30_000


def reference_scan(scratch, variation, *options):
    """Files of a scan over the frame socket of a device of the same seed, by name."""
    key = (variation, options)
    if key not in SCANS:
        device = Device(scratch, variation, "socket", *options, name="reference").ready()
        folder = f"reference-scan-{len(SCANS)}"
        device.scan(folder).ok()
        device.stop()
        SCANS[key] = files(scratch.dir / folder)
        if variation == GREY:
            found = points(SCANS[key]["cloud.ply"])
            expect_true(f"the reference has {found} points, wanted {LEAST_POINTS}", found >= LEAST_POINTS)
    return SCANS[key]


def points(cloud):
    """How many points a PLY file says that it has."""
    return int(re.search(rb"^element vertex (\d+)$", cloud, re.MULTILINE)[1])


def files(folder):
    """Contents of a scan's files that tell no time and no folder."""
    kinds = (".png", ".npy", ".ply", ".toml")
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.suffix in kinds}


def expect_scan(what, folder, wanted):
    """A scan's files have to be these, byte for byte."""
    found = files(folder)
    expect(f"{what}: files", sorted(found), sorted(wanted))
    differ = [name for name in wanted if found[name] != wanted[name]]
    expect(f"{what}: files that differ", differ, [])
    expect(f"{what}: there is a cloud", "cloud.ply" in found, True)
