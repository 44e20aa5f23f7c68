//! What a projector shows: fringes, Gray code, white, black, images; and the sequence manifest
//! that lists them.
//!
//! A projector shows held pixels of its own bit depth: pixel i covers [i - 0.5, i + 0.5) along its
//! axis and has one level over it. A fringe asks for `A + B cos(2 pi x / period_px + phase_rad)` at
//! the pixel's index x, with A = B = half of full scale. Gray code is the reflected binary code of
//! `floor(x / cell_px)`; bit 0 is the least significant.

pub mod manifest;

pub use manifest::{MAX_SIDE_PX, Manifest, ManifestFrame, ProjectorSize};

use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::path::PathBuf;

/// The projector's pixel axis along which a pattern varies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// Along the rows: the column index counts.
    X,
    /// Along the columns: the row index counts.
    Y,
}

impl std::fmt::Display for Axis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::X => "x",
            Self::Y => "y",
        })
    }
}

/// One picture that a projector shows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Pattern {
    /// A sinusoid.
    Fringe {
        /// Axis of variation.
        axis: Axis,
        /// Period in projector pixels, above 2.
        period_px: f64,
        /// Phase in radians at pixel index 0.
        phase_rad: f64,
    },
    /// One bit of a Gray code.
    Gray {
        /// Axis of variation.
        axis: Axis,
        /// Width of a code cell in projector pixels.
        cell_px: f64,
        /// Bits of the whole code.
        bits: u32,
        /// Which bit this picture shows; 0 is the least significant.
        bit: u32,
        /// Whether this is the complement.
        #[serde(default)]
        inverted: bool,
    },
    /// Full on.
    White {},
    /// Full off.
    Black {},
    /// A picture file, a pixel a pixel.
    Image {
        /// Path, relative to the file that names it.
        file: PathBuf,
    },
}

impl Pattern {
    /// The axis that the pattern varies along; `None` for uniform ones and images.
    #[inline]
    pub fn axis(&self) -> Option<Axis> {
        match self {
            Self::Fringe { axis, .. } | Self::Gray { axis, .. } => Some(*axis),
            Self::White {} | Self::Black {} | Self::Image { .. } => None,
        }
    }

    /// The relative level, 0 to 1, asked for at pixel index `x` along the pattern's axis, before
    /// the projector's quantisation. Images have no formula: `None`.
    pub fn level(&self, x: u32) -> Option<f64> {
        match *self {
            Self::Fringe {
                period_px,
                phase_rad,
                ..
            } => {
                // Reduced to one turn in f64 before the cosine: exact for any index.
                let turn = (f64::from(x) / period_px).fract();
                Some(0.5 + 0.5 * (TAU * turn + phase_rad).cos())
            }
            Self::Gray {
                cell_px,
                bit,
                inverted,
                ..
            } => {
                let cell = gray_cell(f64::from(x), cell_px);
                Some(f64::from(u8::from(gray_bit(cell, bit) != inverted)))
            }
            Self::White {} => Some(1.0),
            Self::Black {} => Some(0.0),
            Self::Image { .. } => None,
        }
    }

    /// One row (or column) of `len` held pixels, quantised to `bits` bits: levels 0 to
    /// 2^bits - 1. Images have none.
    ///
    /// A level half-way between two is rounded up wherever it stands in a fringe, however its phase
    /// was written: where 1.57079632679 goes up and 4.71238898038 down, all of a 16-pixel fringe of
    /// 12 steps is 0.0004 px off.
    pub fn quantised_row(&self, len: u32, bits: u32) -> Option<Vec<u16>> {
        /// Part of a level that phases of twelve digits leave open, and much more.
        const TIE: f64 = 1e-6;
        let full = f64::from((1u32 << bits) - 1);
        (0..len)
            .map(|x| Some((self.level(x)? * full + 0.5 + TIE).floor() as u16))
            .collect()
    }
}

/// Axis and period in pixels of the finest fringes among some patterns, x before y where both have
/// it: the ones whose noise the truth speaks of.
pub fn finest_fringe<'a>(patterns: impl Iterator<Item = &'a Pattern>) -> Option<(Axis, f64)> {
    patterns
        .filter_map(|pattern| match *pattern {
            Pattern::Fringe {
                axis, period_px, ..
            } => Some((axis, period_px)),
            _ => None,
        })
        .min_by(|a, b| {
            a.1.total_cmp(&b.1)
                .then((a.0 == Axis::Y).cmp(&(b.0 == Axis::Y)))
        })
}

/// Index of the Gray cell that holds pixel index `x`.
///
/// A quotient within rounding of a whole number counts as that number, so that cells given as
/// decimals (66.6666666667) start where they are meant to.
#[inline]
pub fn gray_cell(x: f64, cell_px: f64) -> u64 {
    let quotient = x / cell_px;
    let nearest = quotient.round();
    if (quotient - nearest).abs() < 1e-9 * nearest.max(1.0) {
        nearest as u64
    } else {
        quotient.floor() as u64
    }
}

/// Bit `bit` of the reflected binary Gray code of `cell`.
#[inline]
pub fn gray_bit(cell: u64, bit: u32) -> bool {
    (gray_encode(cell) >> bit) & 1 == 1
}

/// The reflected binary Gray code of a number.
#[inline]
pub fn gray_encode(n: u64) -> u64 {
    n ^ (n >> 1)
}

/// The number that a reflected binary Gray code stands for.
#[inline]
pub fn gray_decode(code: u64) -> u64 {
    let mut n = code;
    for shift in [1, 2, 4, 8, 16, 32] {
        n ^= n >> shift;
    }
    n
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gray_code_is_a_bijection_with_one_bit_per_step() {
        for n in 0..4096u64 {
            assert_eq!(gray_decode(gray_encode(n)), n);
            assert_eq!((gray_encode(n) ^ gray_encode(n + 1)).count_ones(), 1);
        }
        assert_eq!(gray_decode(gray_encode(u64::MAX)), u64::MAX);
    }

    #[test]
    fn upper_bits_of_a_half_cell_code_are_the_code_of_whole_cells() {
        for x in 0..1920 {
            let (fine, coarse) = (gray_cell(f64::from(x), 8.0), gray_cell(f64::from(x), 16.0));
            assert_eq!(gray_encode(fine) >> 1, gray_encode(coarse));
        }
    }

    #[test]
    fn fringe_follows_the_convention() {
        let fringe = Pattern::Fringe {
            axis: Axis::X,
            period_px: 16.0,
            phase_rad: 0.0,
        };
        let row = fringe.quantised_row(32, 8).unwrap();
        assert_eq!((row[0], row[8], row[16], row[4]), (255, 0, 255, 128));
    }

    /// Rounding to levels moves no fringe as a whole, with phases as profiles have them.
    #[test]
    fn rounding_has_no_side() {
        let (mut sine, mut cosine) = (0.0, 0.0);
        for step in 0..12 {
            let phase_rad = (f64::from(step) * TAU / 12.0 * 1e11).trunc() / 1e11;
            let fringe = Pattern::Fringe {
                axis: Axis::Y,
                period_px: 16.0,
                phase_rad,
            };
            for (x, level) in (0..).zip(fringe.quantised_row(16, 8).unwrap()) {
                let (s, c) = (f64::from(x) / 16.0 * TAU + phase_rad).sin_cos();
                sine += f64::from(level) * s;
                cosine += f64::from(level) * c;
            }
        }
        let off_px = sine.atan2(cosine) * 16.0 / TAU;
        assert!(off_px.abs() < 1e-9, "{off_px}");
    }

    #[test]
    fn decimal_cells_start_on_their_pixel() {
        assert_eq!(gray_cell(200.0, 66.666_666_666_7), 3);
        assert_eq!(gray_cell(199.0, 66.666_666_666_7), 2);
    }
}
