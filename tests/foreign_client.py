"""Drives a served scanner with foreign clients: pyserial, PyVISA-py, and plain sockets.

    phasmid serve --profile webcam-grey --scene plane --run-dir DIR
    python tests/foreign_client.py DIR

Needs `pip install pyserial pyvisa pyvisa-py`. Exits 0 when everything is as the standards have it.
It shares no code with the crate: the frame header is read as its documentation describes it.
"""

import json
import pathlib
import socket
import struct
import sys
import zlib

import pyvisa
import serial

HEADER = struct.Struct("<4sHHQIII4sQQQIIII")


def expect(what, found, wanted):
    if found != wanted:
        sys.exit(f"{what}: found {found!r}, wanted {wanted!r}")
    print(f"ok  {what}")


def read_exactly(stream, length):
    data = bytearray()
    while len(data) < length:
        part = stream.recv(length - len(data))
        if not part:
            sys.exit("the camera has closed the connection")
        data += part
    return bytes(data)


def read_frame(stream):
    raw = read_exactly(stream, HEADER.size)
    (magic, version, length, ident, index, width, height, fourcc, start, end, size, crc, flags,
     reserved, header_crc) = HEADER.unpack(raw)
    expect(f"frame {ident}: magic, version, length", (magic, version, length), (b"PHFR", 1, 72))
    expect(f"frame {ident}: checksum of the header", zlib.crc32(raw[:68]), header_crc)
    pixels = read_exactly(stream, size)
    expect(f"frame {ident}: checksum of the pixels", zlib.crc32(pixels), crc)
    expect(f"frame {ident}: size", size, width * height * {b"GREY": 1, b"Y16 ": 2}[fourcc])
    assert start < end and flags == 0 and reserved == 0
    return ident, index, start, end


def with_pyserial(device):
    control = serial.Serial(device["control"], timeout=5, exclusive=True)

    def tell(line):
        control.write(line.encode() + b"\n")

    def ask(line):
        tell(line)
        return control.readline().decode().rstrip("\n")

    expect("pyserial: *IDN?", ask("*IDN?"), device["name"])
    tell("*RST;*CLS")
    expect("pyserial: error queue is empty", ask("SYST:ERR?"), '0,"No error"')
    tell("FOO:BAR 1")
    tell("CAM:EXP 1e9")
    expect("pyserial: two errors", ask("SYST:ERR:COUN?"), "2")
    expect("pyserial: unknown header", ask("SYSTem:ERRor?").split(",")[0], "-113")
    expect("pyserial: out of range", ask("SYSTem:ERRor:NEXT?").split(",")[0], "-222")
    expect("pyserial: drained", ask("SYST:ERR?"), '0,"No error"')
    tell("camera:exposure 5 ms;gain 3 dB")
    expect("pyserial: exposure in seconds", float(ask("CAM:EXP?")), 0.005)

    # Runs a whole scan.
    tell("TRIG:SOUR BUS;MODE SEQ;:PROJ:POW ON;CURR 0.5")
    camera = socket.socket(socket.AF_UNIX)
    camera.settimeout(10)
    camera.connect(device["camera_socket"].removeprefix("socket:"))
    count = int(ask("SEQ:COUN?"))
    expect("pyserial: armed", ask("INIT;STAT:OPER:COND?"), "32")
    tell("*TRG")
    frames = [read_frame(camera) for _ in range(count)]
    first = frames[0][0]
    expect("frames in order", [f[:2] for f in frames], [(first + i, i) for i in range(count)])
    expect("exposures of 5 ms", {f[3] - f[2] for f in frames}, {5_000_000})
    expect("pyserial: completed", ask("*OPC?"), "1")
    expect("pyserial: no complaint", ask("SYST:ERR?"), '0,"No error"')

    # The manifest arrives as a block.
    tell("SEQ:DATA?")
    expect("pyserial: block", control.read(1), b"#")
    length = int(control.read(int(control.read(1))))
    manifest = control.read(length).decode()
    expect("pyserial: block's end", control.readline(), b"\n")
    expect("a pattern a frame", manifest.count("[[frame]]"), count)
    control.close()
    camera.close()


def with_pyvisa(device):
    manager = pyvisa.ResourceManager("@py")
    # Uses the pty's own name, because VISA resource strings do not accept every path.
    port = pathlib.Path(device["control"]).resolve()
    control = manager.open_resource(
        f"ASRL{port}::INSTR", read_termination="\n", write_termination="\n", timeout=5000
    )
    expect("PyVISA: *IDN?", control.query("*IDN?"), device["name"])
    control.write("*RST;*CLS")
    expect("PyVISA: status byte", control.query_ascii_values("*STB?", converter="d"), [0])
    control.write("NO:SUCH:HEADER")
    expect("PyVISA: status byte", control.query_ascii_values("*STB?", converter="d"), [4])
    expect("PyVISA: unknown header", control.query("SYST:ERR?")[:5], "-113,")
    control.write("TRIG:SOUR BUS;:INIT")
    control.write("*TRG")
    expect("PyVISA: *OPC? waits for the sequence", control.query("*OPC?"), "1")
    block = control.query_binary_values("CAL:DATA?", datatype="B", container=bytes)
    expect("PyVISA: block", b"[camera" in block and b"[projector" in block, True)
    expect("PyVISA: no complaint", control.query("SYST:ERR?"), '0,"No error"')
    control.write("*RST")
    control.close()


def main():
    run_dir = pathlib.Path(sys.argv[1])
    device = json.loads((run_dir / "device.json").read_text())
    with_pyserial(device)
    with_pyvisa(device)
    print("all as it should be")


if __name__ == "__main__":
    main()
