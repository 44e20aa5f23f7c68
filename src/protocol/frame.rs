//! A frame: the pixels of one exposure and what identifies them.

use serde::{Deserialize, Serialize};

/// How a pixel is laid out in memory, named as V4L2 names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum PixelFormat {
    /// One byte a pixel.
    #[serde(rename = "GREY")]
    Grey,
    /// Two bytes a pixel, little-endian, the sensor's bits in the low bits.
    #[serde(rename = "Y16")]
    Y16,
    /// Four bytes a pair of pixels, Y U Y V: what webcams send. The colour is neutral (128), the
    /// width even.
    #[serde(rename = "YUYV")]
    Yuyv,
}

impl PixelFormat {
    /// Bytes that a pixel takes.
    pub fn bytes_per_pixel(self) -> usize {
        match self {
            Self::Grey => 1,
            Self::Y16 | Self::Yuyv => 2,
        }
    }

    /// The four-character code of V4L2.
    pub fn fourcc(self) -> [u8; 4] {
        match self {
            Self::Grey => *b"GREY",
            Self::Y16 => *b"Y16 ",
            Self::Yuyv => *b"YUYV",
        }
    }

    /// The format of a four-character code.
    pub fn from_fourcc(code: [u8; 4]) -> Option<Self> {
        [Self::Grey, Self::Y16, Self::Yuyv]
            .into_iter()
            .find(|format| format.fourcc() == code)
    }
}

impl Frame {
    /// The frame as pairs of pixels with neutral colour; frames of other formats than GREY, and of
    /// odd width, stay as they are.
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

    /// The frame without its colour: YUYV becomes GREY, other formats stay as they are.
    #[must_use]
    pub fn into_luma(self) -> Self {
        if self.format != PixelFormat::Yuyv {
            return self;
        }
        let data = self.data.iter().step_by(2).copied().collect();
        Self {
            format: PixelFormat::Grey,
            data,
            ..self
        }
    }
}

/// One exposure as it reaches an application.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// Identity, counted from the device's start, never repeated.
    pub id: u64,
    /// Position of the projected pattern in the selected sequence; `None` when running free.
    pub pattern_index: Option<u32>,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Layout of `data`.
    pub format: PixelFormat,
    /// Start of the exposure in nanoseconds of device time; with a rolling shutter its first row's.
    pub exposure_start_ns: u64,
    /// End of the exposure in nanoseconds of device time; with a rolling shutter its last row's.
    pub exposure_end_ns: u64,
    /// Pixels row by row without padding: width * height * bytes per pixel.
    pub data: Vec<u8>,
}
