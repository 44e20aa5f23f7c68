"""Drives served scanners with foreign clients: pyserial, PyVISA-py, and plain sockets.

    phasmid serve --profile webcam-grey --scene plane --no-noise --run-dir DIR
    python tests/foreign_client.py DIR [DIR...]

The first device is tested in full, then the pixel formats of each. Without noise, frames of one
pattern are equal, so every format must give the same pixel values.

Needs `pip install pyserial pyvisa pyvisa-py`. Exits 0 when everything is as the standards have it.
It shares no code with the crate: frame header, pixel formats and data line are read as
docs/src/reference/files.md describes them.
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
DATA_LINE = struct.Struct("<2sBBQIQII")
# Bits of a sensor, and the formats that its frames may have. Packed formats come last.
FORMATS = {8: ["GREY", "YUYV"], 10: ["Y16", "Y10", "Y10P"], 12: ["Y16", "Y12", "Y12P"]}
# Pixels of a packed group, and the bits of each pixel in the group's last byte.
PACKED = {"Y10P": (4, 2), "Y12P": (2, 4)}
# Rows of the tested regions, and their widths. Packed groups end with 0 to 3 pixels unfilled.
ROWS = 24
WIDTHS = [304, 303, 302, 301]


def require(what, found, wanted):
    if found != wanted:
        sys.exit(f"{what}: found {found!r}, wanted {wanted!r}")


def expect(what, found, wanted):
    require(what, found, wanted)
    print(f"ok  {what}")


def read_exactly(stream, length):
    data = bytearray()
    while len(data) < length:
        part = stream.recv(length - len(data))
        if not part:
            sys.exit("the camera has closed the connection")
        data += part
    return bytes(data)


class Frame:
    """A frame of the frame socket: header and bytes."""

    def __init__(self, stream):
        raw = read_exactly(stream, HEADER.size)
        (magic, version, length, self.id, self.index, self.width, self.height, fourcc, self.start,
         self.end, size, crc, flags, reserved, header_crc) = HEADER.unpack(raw)
        self.format = fourcc.decode().rstrip()
        at = f"frame {self.id}"
        require(f"{at}: magic, version, length", (magic, version, length), (b"PHFR", 1, 72))
        require(f"{at}: checksum of the header", zlib.crc32(raw[:68]), header_crc)
        require(f"{at}: size", size, bytes_per_row(self.format, self.width) * self.height)
        self.data = read_exactly(stream, size)
        require(f"{at}: checksum of the pixels", zlib.crc32(self.data), crc)
        require(f"{at}: flags, reserved", (flags, reserved), (0, 0))
        require(f"{at}: exposure starts before it ends", self.start < self.end, True)

    def rows(self):
        """Pixel values of each row, the data line included. Checks padding and chroma."""
        length = bytes_per_row(self.format, self.width)
        rows = []
        for y in range(self.height):
            row = self.data[y * length:(y + 1) * length]
            values, rest = unpack(self.format, row, self.width)
            require(f"frame {self.id}, row {y}: rest of the row", any(rest), False)
            rows.append(values)
        return rows


def bytes_per_row(format, width):
    if format in PACKED:
        pixels, _ = PACKED[format]
        return -(-width // pixels) * (pixels + 1)
    return width if format == "GREY" else 2 * width


def unpack(format, row, width):
    """Pixel values of a row, and the values in the rest of its bytes, which must be 0."""
    if format == "GREY":
        return list(row), []
    if format == "YUYV":
        return list(row[::2]), [chroma - 128 for chroma in row[1::2]]
    if format not in PACKED:
        return list(struct.unpack(f"<{width}H", row)), []
    pixels, low = PACKED[format]
    values = []
    for first in range(0, len(row), pixels + 1):
        *high, last = row[first:first + pixels + 1]
        values += [byte << low | last >> low * i & (1 << low) - 1 for i, byte in enumerate(high)]
    return values[:width], values[width:]


def require_data_line(frame, row, bits):
    """Compares the first row's identity and time with the header's."""
    text = "".join("1" if value >= 1 << bits - 1 else "0" for value in row[:256])
    raw = int(text, 2).to_bytes(32, "big")
    wanted = DATA_LINE.pack(
        b"\xa5\x5d", 1, 1, frame.id, frame.index, frame.start, frame.end - frame.start,
        zlib.crc32(raw[:28]))
    require(f"frame {frame.id}: data line", raw, wanted)


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
    frames = [Frame(camera) for _ in range(count)]
    first = frames[0].id
    expect("frames in order", [(f.id, f.index) for f in frames], [(first + i, i) for i in range(count)])
    expect("exposures of 5 ms", {f.end - f.start for f in frames}, {5_000_000})
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


def pixel_formats(device):
    """Reads regions of a sequence in each format. Returns the formats that the sensor has."""
    control = serial.Serial(device["control"], timeout=5, exclusive=True)

    def ask(line):
        control.write(line.encode() + b"\n")
        return control.readline().decode().rstrip("\n")

    expect("formats: reset", ask("*RST;*CLS;TRIG:SOUR BUS;*OPC?"), "1")
    own = ask("CAM:FORM?")
    offered = []
    for format in ["GREY", "YUYV", "Y16", "Y10", "Y12", "Y10P", "Y12P"]:
        refused = ask(f"CAM:FORM {format};:SYST:ERR?").split(",")[0] == "-224"
        if not refused:
            offered.append(format)
            require("format", ask("CAM:FORM?"), format)
    bits = next((bits for bits, formats in FORMATS.items() if formats == offered), None)
    expect(f"{own}: formats {' '.join(offered)} are those of a sensor", bits is not None, True)

    camera = socket.socket(socket.AF_UNIX)
    camera.settimeout(10)
    camera.connect(device["camera_socket"].removeprefix("socket:"))
    count = int(ask("SEQ:COUN?"))
    reference = None
    for format in offered:
        for width in WIDTHS:
            if format == "YUYV" and width % 2 == 1:
                continue
            what = f"{format}, {width} columns"
            region = f"41,100,{width},{ROWS}"
            # A format that needs an even width cannot be selected while the region's is odd.
            control.write(f"CAM:ROI 41,100,{WIDTHS[0]},{ROWS};FORM {format};ROI {region}\n".encode())
            require(what, ask("CAM:FORM?;ROI?"), f"{format};{region}")
            require(what, ask("INIT;*TRG;*OPC?"), "1")
            frames = [Frame(camera) for _ in range(count)]
            require(what, [frame.index for frame in frames], list(range(count)))
            images = []
            for frame in frames:
                rows = frame.rows()
                require(f"{what}: format", (frame.format, frame.width), (format, width))
                require(f"{what}: full scale", max(map(max, rows)) < 1 << bits, True)
                if frame.height == ROWS + 1:
                    require_data_line(frame, rows.pop(0), bits)
                require(f"{what}: rows", len(rows), ROWS)
                images.append(rows)
            if reference is None:
                reference = images
                levels = {value for image in images for row in image for value in row}
                expect(f"{what}: more than half of the range", max(levels) > 1 << bits - 1, True)
                expect(f"{what}: all low bits", {value & 15 for value in levels}, set(range(16)))
            wanted = [[row[:width] for row in image] for image in reference]
            expect(f"{what}: {count} images as in {offered[0]}", images == wanted, True)
    expect("formats: no complaint", ask("SYST:ERR?"), '0,"No error"')
    ask("*RST;*OPC?")
    control.close()
    camera.close()
    return offered


def main():
    files = [pathlib.Path(run_dir) / "device.json" for run_dir in sys.argv[1:]]
    devices = [json.loads(file.read_text()) for file in files]
    with_pyserial(devices[0])
    with_pyvisa(devices[0])
    for device in devices:
        pixel_formats(device)
    print("all as it should be")


if __name__ == "__main__":
    main()
