"""The lane's device profile, and variations of it."""

from .guest import LANE

SCENE = "sphere"
WIDTH, HEIGHT, FRAMES = 320, 240, 12


class Variation:
    """What a device's pixels are on the wire."""

    def __init__(self, fourcc, data_line=True, bits=8):
        self.fourcc, self.data_line, self.bits = fourcc, data_line, bits
        self.bytes_per_pixel = 1 if fourcc == "GREY" else 2
        self.row = WIDTH * self.bytes_per_pixel
        self.height = HEIGHT + (1 if data_line else 0)
        self.size = self.row * self.height

    def text(self):
        text = (LANE / "small.toml").read_text()
        format = self.fourcc if self.fourcc in ("GREY", "YUYV") else "Y16"
        text = replace(text, 'format = "GREY"', f'format = "{format}"')
        text = replace(text, "data_line = true", f"data_line = {str(self.data_line).lower()}")
        # The gain grows with the number of levels, so that the same light covers the same fraction
        # of the range.
        gain = 0.02091 * 2 ** (self.bits - 8)
        text = replace(text, "gain_dn_per_e = 0.02091", f"gain_dn_per_e = {gain}")
        black = "black_level_dn = 4.0\nbits = "
        return replace(text, f"{black}8", f"{black}{self.bits}")

    def write(self, folder):
        path = folder / "profile.toml"
        path.write_text(self.text())
        return path

    def image(self, frame):
        """A frame's pixels without the data line, which tells the time."""
        return frame[self.row:] if self.data_line else frame


def replace(text, old, new):
    assert text.count(old) == 1, old
    return text.replace(old, new)


GREY = Variation("GREY")
PLAIN = Variation("GREY", data_line=False)
YUYV = Variation("YUYV")
# v4l2loopback 0.12 takes Y10 and Y12 for packed formats, unlike V4L2: the device falls back to Y16.
Y10 = Variation("Y16 ", bits=10)
Y12 = Variation("Y16 ", bits=12)
Y16 = Variation("Y16 ", bits=16)
