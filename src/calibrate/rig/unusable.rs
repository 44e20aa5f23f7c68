//! Reasons why a pose cannot be used.

use crate::board::NotFound;
use std::fmt;

/// Messages mention saturation if at least this fraction of the pixels is saturated.
const SATURATED: f64 = 0.01;

/// Width and height of the camera's and of the projector's images.
pub(super) type Sizes = [[u32; 2]; 2];

/// Reasons why the images of a pose cannot be used. Displays as a message for users.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Unusable {
    /// The images or their manifest are invalid: message of the error.
    Invalid(String),
    /// The images show no usable board.
    NoBoard {
        /// Content of the images.
        why: NotFound,
        /// Fraction of the pixels that are saturated in at least one image, 0 to 1.
        saturated: f64,
    },
    /// The camera's or the projector's images have another size than most poses.
    OtherSize {
        /// Width and height in pixels of the camera's and of the projector's images.
        found: Sizes,
        /// The sizes in the majority of poses.
        expected: Sizes,
    },
}

impl fmt::Display for Unusable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = |[camera, projector]: &Sizes| {
            format!(
                "camera {} x {}, projector {} x {} pixels",
                camera[0], camera[1], projector[0], projector[1]
            )
        };
        match self {
            Self::Invalid(why) => f.write_str(why),
            Self::NoBoard { why, saturated } => write!(f, "{why}{}", saturation(*saturated)),
            Self::OtherSize { found, expected } => write!(
                f,
                "images of another size: {}; expected {}, as most poses have",
                words(found),
                words(expected)
            ),
        }
    }
}

/// Describes saturated pixels; empty if there are few.
pub(super) fn saturation(share: f64) -> String {
    match share >= SATURATED {
        true => format!(
            "; {:.0} % of the pixels are saturated: shorten the exposure",
            100.0 * share
        ),
        false => String::new(),
    }
}
