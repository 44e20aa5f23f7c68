//! A slide: a pattern as the projector really shows it, in held pixels of its own bit depth.

use image::GrayImage;
use phasmid_core::error::{Error, Result};
use phasmid_pattern::{Axis, Pattern};
use phasmid_profile::Projector;
use std::path::Path;

/// Levels of 0 to 2^bits - 1 over the projector's pixels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Slide {
    /// One level everywhere.
    Uniform(u16),
    /// A level for each column (x) or row (y).
    Row(Axis, Vec<u16>),
    /// A level for each pixel, row by row.
    Picture {
        /// Columns: the projector's width.
        width: u32,
        /// Rows: the projector's height.
        height: u32,
        /// width * height levels.
        levels: Vec<u16>,
    },
}

impl Slide {
    /// The slide of a pattern; `images` finds the picture that an image pattern names.
    ///
    /// # Errors
    /// What `images` refuses, and a picture that has not the projector's size.
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

    /// A bit of each level, the least significant being 0: full where it is set, else 0.
    #[must_use]
    pub fn plane(&self, bit: u32, bits: u32) -> Self {
        let full = (1u16 << bits) - 1;
        let of = |level: &u16| if level >> bit & 1 == 1 { full } else { 0 };
        match self {
            Self::Uniform(level) => Self::Uniform(of(level)),
            Self::Row(axis, levels) => Self::Row(*axis, levels.iter().map(of).collect()),
            Self::Picture {
                width,
                height,
                levels,
            } => Self::Picture {
                width: *width,
                height: *height,
                levels: levels.iter().map(of).collect(),
            },
        }
    }

    /// The levels that it holds: one, a row of them, or a picture of them.
    pub fn levels(&self) -> &[u16] {
        match self {
            Self::Uniform(level) => std::slice::from_ref(level),
            Self::Row(_, levels) | Self::Picture { levels, .. } => levels,
        }
    }

    /// The slide of a picture; its 8 bits are rounded to the projector's.
    ///
    /// # Errors
    /// A picture that has not the projector's size.
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
        Ok(Self::Picture {
            width,
            height,
            levels,
        })
    }
}
