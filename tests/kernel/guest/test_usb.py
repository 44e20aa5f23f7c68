"""The device as a USB device: the stock drivers take it for hardware."""

import json
import os
import pathlib
import re
import signal
import time

import serial

from lab import usb
from lab.data_line import Line
from lab.device import FrameSocket, expect_scan, reference_scan
from lab.failure import expect, expect_in, expect_true, limit, whole
from lab.guest import PHASMID, wait_until
from lab.profiles import GREY, SCENE, Y12, YUYV, replace
from lab.streams import split
from lab.usb import UsbDevice, UsbVariation, plugged

# Number of cycles of plugging and unplugging until the server's resources are steady.
WARM_UP = 10


def test_both_drivers_bind_and_lsusb_reads_it(scratch):
    device = plugged(scratch, GREY)
    said = scratch.run("lsusb", "-v", "-d", "1209:0001").ok().out
    for part in (
        "bcdUSB               2.00", "idVendor           0x1209", "iManufacturer           1 Phasmid",
        "iProduct                2 small", "iSerial                 3 0001", "bNumInterfaces          4",
        "bcdUVC               1.10", "Exposure Time (Absolute)", "Gain", "{30303859-0000-0010-8000-00aa00389b71}",
        "CDC ACM:", "CDC Union:", "Transfer Type            Bulk", "MaxPower              500mA",
    ):
        expect_in("lsusb -v", part, said)
    for wrong in ("error", "unknown", "Warning", "can't get", "INVALID"):
        expect(f"lsusb -v says {wrong}", [l for l in said.splitlines() if wrong in l], [])
    device.stop()


@limit(240)
def test_a_scan_gives_the_frames_of_the_frame_socket(scratch):
    super_speed = UsbVariation(GREY, 'speed = "super"')
    for name, variation in (("grey", GREY), ("yuyv", YUYV), ("y12", Y12), ("super", super_speed)):
        # The device and its scan use separate folders.
        wanted = reference_scan(scratch, getattr(variation, "base", variation))
        device = UsbDevice(scratch, variation, name=f"device-{name}").ready().plugged()
        device.scan_usb(name).ok()
        expect_scan(f"{name} over USB", scratch.dir / name, wanted)
        device.stop()


def test_isochronous_frames_come_whole(scratch):
    device = plugged(scratch, UsbVariation(GREY, 'transfer = "isochronous"'), "--no-noise")
    saved = scratch.dir / "saved"
    done = scratch.run(
        "v4l2-ctl", "-d", device.node, "--verbose", "--stream-mmap", "--stream-count=10",
        f"--stream-to={saved}", seconds=80).ok()
    frames = split(saved.read_bytes(), GREY)
    expect("frames", len(frames), 10)
    expect("images that are alike", len({GREY.image(frame) for frame in frames}), 1)
    ids = [Line(frame, GREY).id for frame in frames]
    # uvcvideo numbers frames when they begin, but copies each transfer in a separate worker. On a
    # busy machine, a small frame may be complete before the previous frame, and is then delivered
    # first.
    numbers = [int(n) for n in re.findall(r"dqbuf: *\d+ seq: *(\d+)", done.out + done.err)]
    expect_true(f"ten numbers of the driver in {numbers}", len(numbers) >= 10)
    as_begun = [at for _, at in sorted(zip(numbers, ids))]
    expect("ids in the driver's order and never twice", as_begun, sorted(set(ids)))
    device.stop()


def test_controls_are_one_state_with_the_commands(scratch):
    device = plugged(scratch, GREY)

    def control(name):
        said = scratch.run("v4l2-ctl", "-d", device.node, "-C", name).ok().out
        return int(said.split(":")[1])

    with serial.Serial(device.port, timeout=20) as port:
        def ask(line):
            port.write(line.encode() + b"\n")
            return port.readline().decode().strip()

        scratch.run("v4l2-ctl", "-d", device.node, "-c", "exposure_time_absolute=77,gain=450").ok()
        expect("CAMera:EXPosure?", float(ask("CAM:EXP?")), 0.0077)
        expect("CAMera:GAIN?", float(ask("CAM:GAIN?")), 4.5)
        expect("no error", ask("CAM:EXP 0.005;GAIN 3;:SYST:ERR?"), '0,"No error"')
        expect("exposure", control("exposure_time_absolute"), 50)
        expect("gain", control("gain"), 300)
    device.stop()


@whole
@limit(300)
def test_a_thousand_frames_without_loss(scratch):
    device = plugged(scratch, GREY, "--no-noise")
    saved = scratch.dir / "saved"
    reader = scratch.start(
        "v4l2-ctl", "-d", device.node, "--verbose", "--stream-mmap=16", "--stream-count=1050",
        f"--stream-to={saved}")
    wait_until("STREAMON", lambda: "VIDIOC_STREAMON" in "".join(reader.said()))
    # Uses triggers, because a free-running camera drops frames that a busy machine cannot render in
    # time.
    with serial.Serial(device.port, timeout=20) as port:
        port.write(b"INIT:CONT OFF;:ABOR;:TRIG:SOUR BUS;MODE SEQ;:SEQ:PER 0.02;:SYST:ERR?\n")
        expect("armed", port.readline(), b'0,"No error"\n')
        for _ in range(90):
            port.write(b"INIT;*TRG;*OPC?\n")
            expect("a sequence is over", port.readline(), b"1\n")
            if not reader.running():
                break
    reader.wait(30).ok()
    lines = [Line(frame, GREY) for frame in split(saved.read_bytes(), GREY)]
    lines = [line for line in lines if line.index is not None]
    expect_true(f"{len(lines)} triggered frames, wanted 1000", len(lines) >= 1000)
    for what, wanted in (("id", 1), ("index", 1)):
        steps = {(getattr(b, what) - getattr(a, what)) % 12 for a, b in zip(lines, lines[1:])}
        expect(f"steps from {what} to {what}", steps, {wanted})
    expect("ids", lines[-1].id - lines[0].id, len(lines) - 1)
    device.stop()


def test_rts_triggers_and_dsr_tells(scratch):
    device = plugged(scratch, UsbVariation(GREY, 'rts = "trigger"\ndsr = "sync"'))
    frames = FrameSocket(device)
    with serial.Serial(device.port, timeout=20) as port:
        port.rts = False
        port.write(b"INIT:CONT OFF;:ABOR;:TRIG:SOUR EXT;MODE SEQ;:INIT;:SYST:ERR?\n")
        expect("armed", port.readline(), b'0,"No error"\n')
        expect("DSR at rest", port.dsr, False)
        port.rts = True
        wait_until("DSR while a sequence is projected", lambda: port.dsr)
        # Skips the frames of the free-running camera.
        index = None
        while index is None:
            index = Line(frames.frame(), GREY).index
        expect("the first frame of the sequence", index, 0)
        wait_until("DSR after it", lambda: not port.dsr)
    frames.close()
    device.stop()


@whole
@limit(150)
def test_unplugged_in_a_scan_and_plugged_in_again(scratch):
    wanted = reference_scan(scratch, GREY, "--no-noise")
    device = plugged(scratch, GREY, "--no-noise")
    job = device.scan_usb("broken", wait=False)
    wait_until("the scan opens the camera", lambda: job.has_open(device.node))
    time.sleep(0.8)
    usb.pull()
    done = job.wait(60).with_status(1)
    expect("lines that it says", len(done.err.strip().splitlines()), 1)
    expect_true(f"it says what: {done.err}", re.search(r"/dev/(video|ttyACM)", done.err))
    for part in ("not come back within 20 s", "USB device 1209:0001 with serial number 0001"):
        expect_in("it says what it has waited for", part, done.err)
    listed = scratch.run("usbip", "list", "-r", "127.0.0.1").ok().out
    for part in ("1-1", "1209:0001"):
        expect_in("usbip list", part, listed)
    usb.plug(scratch)
    device.plugged()
    device.scan_usb("next").ok()
    expect_scan("the next scan", scratch.dir / "next", wanted)
    device.stop()


@whole
@limit(240)
def test_unplugged_in_a_scan_that_goes_on_when_it_is_back(scratch):
    wanted = reference_scan(scratch, GREY, "--no-noise")
    device = plugged(scratch, GREY, "--no-noise")
    before = device.node, device.port
    # While a program holds a node open, the device that comes back cannot get the node's name.
    for node in before:
        scratch.hold(os.open(node, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK))
    job = device.scan_usb("scan", wait=False)
    wait_until("the scan opens the camera", lambda: job.has_open(device.node))
    time.sleep(0.8)
    usb.pull()
    usb.plug(scratch)
    device.plugged()
    expect_true(f"other names than {before}", device.node != before[0] and device.port != before[1])
    done = job.wait(120).ok()
    expect_in("it says that it begins anew", "; scanning again", done.err)
    expect_scan("the scan", scratch.dir / "scan", wanted)
    device.stop()


@whole
@limit(400)
def test_fifty_times_in_and_out(scratch):
    device = UsbDevice(scratch, GREY, how="export").ready()
    after = []
    with scratch.log("resources") as log:
        for cycle in range(50):
            usb.plug(scratch)
            device.plugged()
            if cycle % 2 == 0:
                scratch.run("v4l2-ctl", "-d", device.node, "--stream-mmap", "--stream-count=2").ok()
            usb.pull()
            after.append(device.resources())
            log.write(f"cycle {cycle}: descriptors, resident kB: {after[-1]}\n")
    warm = after[:WARM_UP]
    # A connection may stay open for a moment after its device has been unplugged.
    least = min(descriptors for descriptors, _ in warm)
    wait_until(f"{least} descriptors", lambda: device.resources()[0] == least)
    # A leak makes memory grow in both halves; an allocator that takes another page does so in only
    # one.
    resident = [kilobytes for _, kilobytes in after]
    halves = resident[29] - resident[WARM_UP - 1], resident[49] - resident[29]
    expect_true(f"memory grew by {halves} kB in twenty cycles each",
                min(halves) < 256 and sum(halves) < 2048)
    device.stop()


@whole
def test_two_devices_of_one_server(scratch):
    wanted = reference_scan(scratch, GREY, "--no-noise")
    usb.load()
    text = pathlib.Path(GREY.write(scratch.dir)).read_text()
    profiles = []
    for name in ("left", "right"):
        one = replace(text, 'name = "small"', f'name = "{name}"')
        one = replace(one, 'serial = "0001"', f'serial = "{name}"')
        profiles.append(scratch.dir / f"{name}.toml")
        profiles[-1].write_text(one)
    job = scratch.start(
        PHASMID, "serve", "--usb", "attach", "--no-noise", "--scene", SCENE, "--run-dir", scratch.dir / "desk",
        "--profile", profiles[0], "--profile", profiles[1])
    files = [scratch.dir / "desk" / name / "device.json" for name in ("left", "right")]
    wait_until("both devices", lambda: all(file.exists() for file in files), 30)
    told = [json.loads(file.read_text()) for file in files]
    expect("different cameras", len({one["camera"] for one in told}), 2)
    scans = [
        scratch.start(
            PHASMID, "scan", "--camera", one["camera"], "--control", one["control_usb"], "--timeout", "20",
            "--json", "--out", scratch.dir / name)
        for one, name in zip(told, ("left", "right"))
    ]
    for scan, name in zip(scans, ("left", "right")):
        done = scan.wait(90).ok()
        expect_in("the device's name", name, done.out)
        expect_scan(f"the scan of {name}", scratch.dir / name, wanted)
    job.send(signal.SIGTERM)
    job.wait(20).ok()
    wait_until("the cameras are gone", lambda: usb.video_node() is None)


@whole
def test_killed_while_attached(scratch):
    device = plugged(scratch, GREY)
    device.job.send(signal.SIGKILL)
    device.job.process.wait()
    wait_until("the camera is gone", lambda: usb.video_node() is None)
    again = UsbDevice(scratch, GREY, name="again").ready().plugged()
    again.scan_usb("next").ok()
    again.stop()
