//! A pattern image: a pattern as the projector displays it, in projector pixels with the projector's
//! bit depth.

use image::GrayImage;
use phasmid_core::error::{Error, Result};
use phasmid_pattern::{Axis, Pattern};
use phasmid_profile::Projector;
use std::path::Path;

/// Levels, 0 to 2^bits - 1, of the projector's pixels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PatternImage {
    /// The same level everywhere.
    Uniform(u16),
    /// One level per column (x) or row (y).
    Row(Axis, Vec<u16>),
    /// One level per pixel, row-major.
    Image {
        /// Columns: the projector's width.
        width: u32,
        /// Rows: the projector's height.
        height: u32,
        /// width * height levels.
        levels: Vec<u16>,
    },
}

impl PatternImage {
    /// Creates the pattern image of a pattern; `images` loads the file that an image pattern names.
    ///
    /// # Errors
    /// Returns an error if `images` fails or if the image does not have the projector's size.
    pub fn new(
        pattern: &Pattern,
        projector: &Projector,
        images: &dyn Fn(&Path) -> Result<GrayImage>,
    ) -> Result<Self> {
        let full = (1u16 << projector.bits) - 1;
        Ok(match pattern {
            Pattern::White {} => Self::Uniform(full),
            Pattern::Black {} => Self::Uniform(0),
            Pattern::Image { file } => {
                Self::from_image(&images(file)?, projector, &file.display().to_string())?
            }
            Pattern::Fringe { axis, .. } | Pattern::Gray { axis, .. } => {
                let len = match axis {
                    Axis::X => projector.width_px,
                    Axis::Y => projector.height_px,
                };
                let row = pattern
                    .quantised_row(len, projector.bits)
                    .expect("fringes and Gray codes have a formula");
                Self::Row(*axis, row)
            }
        })
    }

    /// Returns the image of one bit plane (0 is the least significant bit): full level where the bit
    /// is set, else 0.
    #[must_use]
    pub fn plane(&self, bit: u32, bits: u32) -> Self {
        let full = (1u16 << bits) - 1;
        let of = |level: &u16| if level >> bit & 1 == 1 { full } else { 0 };
        match self {
            Self::Uniform(level) => Self::Uniform(of(level)),
            Self::Row(axis, levels) => Self::Row(*axis, levels.iter().map(of).collect()),
            Self::Image {
                width,
                height,
                levels,
            } => Self::Image {
                width: *width,
                height: *height,
                levels: levels.iter().map(of).collect(),
            },
        }
    }

    /// Returns the levels: one level, one per column or row, or one per pixel.
    pub fn levels(&self) -> &[u16] {
        match self {
            Self::Uniform(level) => std::slice::from_ref(level),
            Self::Row(_, levels) | Self::Image { levels, .. } => levels,
        }
    }

    /// Creates a pattern image from an 8-bit image, rounding the levels to the projector's bit depth.
    ///
    /// # Errors
    /// Returns an error if the image does not have the projector's size.
    pub fn from_image(image: &GrayImage, projector: &Projector, place: &str) -> Result<Self> {
        let (width, height) = image.dimensions();
        if (width, height) != (projector.width_px, projector.height_px) {
            return Err(Error::input(
                place,
                format!("{width} x {height} pixels"),
                format!(
                    "the projector's {} x {} pixels",
                    projector.width_px, projector.height_px
                ),
            ));
        }
        let full = (1u32 << projector.bits) - 1;
        let levels = image
            .as_raw()
            .iter()
            .map(|&level| ((u32::from(level) * full * 2 + 255) / 510) as u16)
            .collect();
        Ok(Self::Image {
            width,
            height,
            levels,
        })
    }
}
