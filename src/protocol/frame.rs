//! A frame: the pixels of one exposure and what identifies them.

use serde::{Deserialize, Serialize};

/// Memory layout of a pixel, named as in V4L2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
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
}

impl PixelFormat {
    /// Returns the number of bytes per pixel.
    pub fn bytes_per_pixel(self) -> usize {
        match self {
            Self::Grey => 1,
            Self::Y16 | Self::Yuyv => 2,
        }
    }

    /// Returns the V4L2 four-character code.
    pub fn fourcc(self) -> [u8; 4] {
        match self {
            Self::Grey => *b"GREY",
            Self::Y16 => *b"Y16 ",
            Self::Yuyv => *b"YUYV",
        }
    }

    /// Returns the format with a V4L2 four-character code.
    pub fn from_fourcc(code: [u8; 4]) -> Option<Self> {
        [Self::Grey, Self::Y16, Self::Yuyv]
            .into_iter()
            .find(|format| format.fourcc() == code)
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

    /// Converts a YUYV frame to GREY by dropping its chroma; other formats are returned unchanged.
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
    /// Pixels in row-major order without padding: width * height * bytes per pixel.
    pub data: Vec<u8>,
}
