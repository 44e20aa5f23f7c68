"""A scan by nobody's software but OpenCV and pyserial: python3 opencv_scan.py NODE PORT FOLDER

Triggers a sequence over the serial port, reads its frames from the camera, tells them by their data
lines, and leaves pictures, manifest and calibration in the folder, for `phasmid decode`.
"""

import pathlib
import sys

import cv2
import numpy
import serial


def data_line(row):
    raw = numpy.packbits(row[:256] > 128).tobytes()
    assert raw[:2] == b"\xa5\x5d", raw.hex()
    return int.from_bytes(raw[4:12], "little"), int.from_bytes(raw[12:16], "little"), raw[3] & 1


def main(node, port, folder):
    folder = pathlib.Path(folder)
    folder.mkdir()
    camera = cv2.VideoCapture(node, cv2.CAP_V4L2)
    assert camera.isOpened(), f"{node} does not open"
    assert camera.set(cv2.CAP_PROP_CONVERT_RGB, 0)
    # OpenCV starts streaming when the first frame is read.
    assert camera.read()[0], "the camera does not run free"

    with serial.Serial(port, timeout=20) as control:
        def ask(line):
            control.write(line.encode() + b"\n")
            return control.readline().decode().strip()

        def block(line):
            control.write(line.encode() + b"\n")
            assert control.read(1) == b"#"
            length = int(control.read(int(control.read(1))))
            data = control.read(length)
            assert control.readline() == b"\n"
            return data.decode()

        count = int(ask("*CLS;:ABOR;:TRIG:SOUR BUS;MODE SEQ;:SEQ:COUN?"))
        manifest, calibration = block("SEQ:DATA?"), block("CAL:DATA?")
        assert ask("INIT;:SYST:ERR?") == '0,"No error"'
        control.write(b"*TRG\n")
        frames = {}
        while len(frames) < count:
            grabbed, frame = camera.read()
            assert grabbed, "the camera gives no frame"
            # OpenCV prefers YUYV if the camera offers it: keeps only the luma.
            frame = frame.reshape(241, 320, -1)[:, :, 0]
            identity, index, triggered = data_line(frame[0])
            # Frames from before the trigger belong to the free-running camera.
            if triggered:
                frames[index] = (identity, frame[1:])
        assert ask("*OPC?") == "1"
        assert ask("SYST:ERR?") == '0,"No error"'

    ids = [frames[index][0] for index in range(count)]
    assert ids == list(range(ids[0], ids[0] + count)), ids
    for index in range(count):
        assert cv2.imwrite(str(folder / f"frame_{index:02}.png"), frames[index][1])
        manifest = manifest.replace("[[frame]]\n", f'[[ frame ]]\nfile = "frame_{index:02}.png"\n', 1)
    (folder / "sequence.toml").write_text(manifest)
    (folder / "calibration.toml").write_text(calibration)


if __name__ == "__main__":
    main(*sys.argv[1:])
