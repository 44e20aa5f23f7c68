//! A frame: the pixels of one exposure and what identifies them.

use phasmid_core::error::{Error, Result};
use phasmid_pattern::{Image, Samples};
use serde::{Deserialize, Serialize};

/// Memory layout of a row of pixels, named as in V4L2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum PixelFormat {
    /// One byte per pixel.
    #[serde(rename = "GREY")]
    Grey,
    /// Two bytes per pixel, little-endian; the sensor's bits are the low bits.
    #[serde(rename = "Y16")]
    Y16,
    /// Four bytes per pair of pixels (Y U Y V), the usual format of webcams. Chroma is neutral
    /// (128) and the width is even.
    #[serde(rename = "YUYV")]
    Yuyv,
    /// Two bytes per pixel, like Y16, from a sensor of 9 or 10 bits.
    #[serde(rename = "Y10")]
    Y10,
    /// Two bytes per pixel, like Y16, from a sensor of 11 or 12 bits.
    #[serde(rename = "Y12")]
    Y12,
    /// MIPI RAW10: five bytes per four pixels. Four bytes hold the high 8 bits of a pixel each, the
    /// fifth their low 2 bits, of the first pixel in bits 1 to 0.
    #[serde(rename = "Y10P")]
    Y10P,
    /// MIPI RAW12: three bytes per two pixels. Two bytes hold the high 8 bits of a pixel each, the
    /// third their low 4 bits, of the first pixel in bits 3 to 0.
    #[serde(rename = "Y12P")]
    Y12P,
}

impl PixelFormat {
    /// All formats.
    pub const ALL: [Self; 7] = [
        Self::Grey,
        Self::Y16,
        Self::Yuyv,
        Self::Y10,
        Self::Y12,
        Self::Y10P,
        Self::Y12P,
    ];

    /// Returns the number of bytes per pixel, rounded up for the packed formats; see
    /// [`Self::row_bytes`] for their exact size.
    pub fn bytes_per_pixel(self) -> usize {
        self.bits_per_pixel().div_ceil(8)
    }

    /// Returns the number of bits that a pixel occupies on average.
    pub fn bits_per_pixel(self) -> usize {
        match self {
            Self::Grey => 8,
            Self::Y16 | Self::Yuyv | Self::Y10 | Self::Y12 => 16,
            Self::Y10P => 10,
            Self::Y12P => 12,
        }
    }

    /// Returns the largest value of a pixel.
    pub fn max_value(self) -> u16 {
        match self {
            Self::Grey | Self::Yuyv => 0xFF,
            Self::Y10 | Self::Y10P => 0x3FF,
            Self::Y12 | Self::Y12P => 0xFFF,
            Self::Y16 => u16::MAX,
        }
    }

    /// Returns whether pixels share bytes.
    pub fn is_packed(self) -> bool {
        matches!(self, Self::Y10P | Self::Y12P)
    }

    /// Returns the number of bytes in a row. Packed rows are padded to whole groups of pixels.
    pub fn row_bytes(self, width: u32) -> usize {
        let width = width as usize;
        match self {
            Self::Grey => width,
            Self::Y16 | Self::Yuyv | Self::Y10 | Self::Y12 => 2 * width,
            Self::Y10P => 5 * width.div_ceil(4),
            Self::Y12P => 3 * width.div_ceil(2),
        }
    }

    /// Returns the number of bytes in a frame without padding between rows.
    pub fn frame_bytes(self, width: u32, height: u32) -> usize {
        self.row_bytes(width) * height as usize
    }

    /// Returns the name: the four-character code without trailing spaces.
    pub fn name(self) -> &'static str {
        match self {
            Self::Grey => "GREY",
            Self::Y16 => "Y16",
            Self::Yuyv => "YUYV",
            Self::Y10 => "Y10",
            Self::Y12 => "Y12",
            Self::Y10P => "Y10P",
            Self::Y12P => "Y12P",
        }
    }

    /// Returns the V4L2 four-character code.
    pub fn fourcc(self) -> [u8; 4] {
        match self {
            Self::Grey => *b"GREY",
            Self::Y16 => *b"Y16 ",
            Self::Yuyv => *b"YUYV",
            Self::Y10 => *b"Y10 ",
            Self::Y12 => *b"Y12 ",
            Self::Y10P => *b"Y10P",
            Self::Y12P => *b"Y12P",
        }
    }

    /// Returns the format with a V4L2 four-character code.
    pub fn from_fourcc(code: [u8; 4]) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.fourcc() == code)
    }
}

impl Frame {
    /// Converts a GREY frame of even width to YUYV with neutral chroma; other frames are returned
    /// unchanged.
    #[must_use]
    pub fn into_yuyv(self) -> Self {
        if self.format != PixelFormat::Grey || self.width % 2 == 1 {
            return self;
        }
        let data = self.data.iter().flat_map(|luma| [*luma, 128]).collect();
        Self {
            format: PixelFormat::Yuyv,
            data,
            ..self
        }
    }

    /// Converts a Y16 frame to Y10, Y12, Y10P or Y12P. Values too large for the format are clamped.
    /// Frames and formats of another kind are returned unchanged.
    #[must_use]
    pub fn into_depth(self, format: PixelFormat) -> Self {
        let narrow = matches!(
            format,
            PixelFormat::Y10 | PixelFormat::Y12 | PixelFormat::Y10P | PixelFormat::Y12P
        );
        if self.format != PixelFormat::Y16 || !narrow {
            return self;
        }
        self.repacked(format)
    }

    /// Converts YUYV to GREY by dropping its chroma, and Y10, Y12 and the packed formats to Y16
    /// with the same values; GREY and Y16 frames are returned unchanged.
    #[must_use]
    pub fn into_luma(self) -> Self {
        match self.format {
            PixelFormat::Grey | PixelFormat::Y16 => self,
            PixelFormat::Yuyv => {
                let data = self.data.iter().step_by(2).copied().collect();
                Self {
                    format: PixelFormat::Grey,
                    data,
                    ..self
                }
            }
            // Y10 and Y12 have the layout of Y16.
            PixelFormat::Y10 | PixelFormat::Y12 => Self {
                format: PixelFormat::Y16,
                ..self
            },
            PixelFormat::Y10P | PixelFormat::Y12P => self.repacked(PixelFormat::Y16),
        }
    }

    /// Unpacks the pixels: 8-bit samples from GREY and from YUYV, whose chroma is dropped, and 16-bit
    /// samples from the other formats.
    ///
    /// # Errors
    /// Returns an error if the number of bytes does not match the size and format.
    pub fn into_image(self) -> Result<Image> {
        let (width, height) = (self.width as usize, self.height as usize);
        let expected = self.format.frame_bytes(self.width, self.height);
        if self.data.len() != expected {
            return Err(Error::device(format!(
                "frame {}: {} bytes, expected {expected} for {width} x {height} pixels of {}",
                self.id,
                self.data.len(),
                self.format.name()
            )));
        }
        let luma = self.into_luma();
        let samples = match luma.format {
            PixelFormat::Grey => Samples::U8(luma.data),
            _ => {
                let (pairs, _) = luma.data.as_chunks();
                Samples::U16(pairs.iter().map(|pair| u16::from_le_bytes(*pair)).collect())
            }
        };
        Image::new(width, height, samples)
    }

    /// Rewrites the values of all complete rows in another format.
    fn repacked(self, format: PixelFormat) -> Self {
        let mut values = vec![0; self.width as usize];
        let mut data = Vec::with_capacity(format.frame_bytes(self.width, self.height));
        let row = self.format.row_bytes(self.width).max(1);
        for bytes in self.data.chunks_exact(row) {
            self.format.unpack_row(bytes, &mut values);
            format.pack_row(&values, &mut data);
        }
        Self {
            format,
            data,
            ..self
        }
    }
}

/// One exposure as an application receives it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// Frame id, counted from power-on and never repeated.
    pub id: u64,
    /// Position of the projected pattern in the selected sequence; `None` when running free.
    pub pattern_index: Option<u32>,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Layout of `data`.
    pub format: PixelFormat,
    /// Start of the exposure in nanoseconds of device time; with a rolling shutter, that of the
    /// first row.
    pub exposure_start_ns: u64,
    /// End of the exposure in nanoseconds of device time; with a rolling shutter, that of the last
    /// row.
    pub exposure_end_ns: u64,
    /// Rows from top to bottom, without padding between them: [`PixelFormat::frame_bytes`] bytes.
    pub data: Vec<u8>,
}
