//! Projected patterns (fringes, Gray code, white, black, images), the sequence manifest that lists
//! them, and the grey image, shared by device and host. Depends only on `phasmid-core`.
//!
//! | module | contents |
//! | --- | --- |
//! | [`image`] | a grey image of 8 or 16 bits |
//! | [`manifest`] | the sequence manifest: patterns and frame files, checked |
//! | [`written`] | patterns as files write them: one by one or in sets |
//!
//! A projector shows pixels of constant level, in its own bit depth: pixel i covers [i - 0.5, i + 0.5)
//! along its axis and has one level there. A fringe is `A + B cos(2 pi x / period_px + phase_rad)`,
//! sampled at pixel index x, with A = B = half of full scale. Gray code is the reflected binary code of
//! `floor(x / cell_px)`; bit 0 is the least significant.

pub mod image;
pub mod manifest;
pub mod written;

pub use image::{Image, ImageView, Samples, SamplesView};
pub use manifest::{MAX_SIDE_PX, Manifest, ManifestFrame, ProjectorSize};

use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::path::PathBuf;

/// The projector's pixel axis along which a pattern varies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// Along the rows: the level depends on the column index.
    X,
    /// Along the columns: the level depends on the row index.
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

/// One projected image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", try_from = "written::Patterns")]
pub enum Pattern {
    /// A sinusoidal fringe.
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
        /// Number of bits of the complete code.
        bits: u32,
        /// Index of the bit shown; 0 is the least significant.
        bit: u32,
        /// Whether the bit is shown inverted.
        inverted: bool,
    },
    /// Uniform, full brightness.
    White {},
    /// Uniform, zero brightness.
    Black {},
    /// An image file, shown pixel for pixel.
    Image {
        /// Path, relative to the file that contains this entry.
        file: PathBuf,
    },
}

impl Pattern {
    /// Returns fringes whose phases are equally spaced over one turn: step k has the phase
    /// `phase_rad + 2 pi k / steps`.
    ///
    /// ```
    /// use phasmid_pattern::{Axis, Pattern};
    ///
    /// let set = Pattern::fringe_set(Axis::X, 16.0, 4, 0.0);
    /// assert_eq!(set.len(), 4);
    /// assert_eq!(set[2].level(0), Some(0.0));
    /// ```
    pub fn fringe_set(axis: Axis, period_px: f64, steps: u32, phase_rad: f64) -> Vec<Self> {
        let fringe = |step| Self::Fringe {
            axis,
            period_px,
            phase_rad: phase_rad + TAU * f64::from(step) / f64::from(steps),
        };
        (0..steps).map(fringe).collect()
    }

    /// Returns all bits of a Gray code, the most significant first. With `half_cell`, the finest bit of
    /// the code with cells half as wide follows; it determines the order where two cells meet. With
    /// `inverted`, each bit is followed by its inverse.
    ///
    /// ```
    /// use phasmid_pattern::{Axis, Pattern};
    ///
    /// assert_eq!(Pattern::gray_set(Axis::X, 16.0, 6, true, false).len(), 7);
    /// ```
    pub fn gray_set(
        axis: Axis,
        cell_px: f64,
        bits: u32,
        half_cell: bool,
        inverted: bool,
    ) -> Vec<Self> {
        let whole = (0..bits).rev().map(|bit| (cell_px, bits, bit));
        let half = half_cell.then_some((cell_px / 2.0, bits + 1, 0));
        let inverses: &[bool] = if inverted { &[false, true] } else { &[false] };
        let shown = |(cell_px, bits, bit)| {
            let gray = move |&inverted| Self::Gray {
                axis,
                cell_px,
                bits,
                bit,
                inverted,
            };
            inverses.iter().map(gray)
        };
        whole.chain(half).flat_map(shown).collect()
    }

    /// Returns the axis along which the pattern varies; `None` for uniform patterns and images.
    #[inline]
    pub fn axis(&self) -> Option<Axis> {
        match self {
            Self::Fringe { axis, .. } | Self::Gray { axis, .. } => Some(*axis),
            Self::White {} | Self::Black {} | Self::Image { .. } => None,
        }
    }

    /// Returns the nominal relative level, 0 to 1, at pixel index `x` along the pattern's axis,
    /// before quantisation by the projector. `None` for images.
    pub fn level(&self, x: u32) -> Option<f64> {
        match *self {
            Self::Fringe {
                period_px,
                phase_rad,
                ..
            } => {
                // Reduce the angle to one turn in f64 before the cosine is taken: this is exact for any
                // index.
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

    /// Returns one row (or column) of `len` projector pixels, quantised to `bits` bits: levels 0 to
    /// 2^bits - 1. `None` for images.
    ///
    /// A level half-way between two integers is always rounded up, regardless of the rounding of
    /// the written phase. Without this, 1.57079632679 rounds up and 4.71238898038 down, which
    /// shifts a 16-pixel fringe with 12 phase steps by 0.0004 px.
    pub fn quantised_row(&self, len: u32, bits: u32) -> Option<Vec<u16>> {
        /// Tolerance in levels for ties; far above the error of phases written with twelve digits.
        const TIE: f64 = 1e-6;
        let full = f64::from((1u32 << bits) - 1);
        (0..len)
            .map(|x| Some((self.level(x)? * full + 0.5 + TIE).floor() as u16))
            .collect()
    }
}

/// Returns the axis and period in pixels of the finest fringe among the patterns, x before y on a
/// tie. Ground-truth noise refers to this fringe.
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

/// Returns the index of the Gray-code cell that contains pixel index `x`.
///
/// A quotient within rounding error of an integer is taken as that integer, so that cell sizes
/// written as decimals (66.6666666667) start on the intended pixel.
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

/// Returns bit `bit` of the reflected binary Gray code of `cell`.
#[inline]
pub fn gray_bit(cell: u64, bit: u32) -> bool {
    (gray_encode(cell) >> bit) & 1 == 1
}

/// Returns the reflected binary Gray code of a number.
#[inline]
pub fn gray_encode(n: u64) -> u64 {
    n ^ (n >> 1)
}

/// Returns the number encoded by a reflected binary Gray code.
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
    fn fringe_is_brightest_at_phase_zero() {
        let fringe = Pattern::Fringe {
            axis: Axis::X,
            period_px: 16.0,
            phase_rad: 0.0,
        };
        let row = fringe.quantised_row(32, 8).unwrap();
        assert_eq!((row[0], row[8], row[16], row[4]), (255, 0, 255, 128));
    }

    /// Rounding to levels does not shift a fringe, for phases written as in the profiles.
    #[test]
    fn rounding_of_levels_does_not_shift_a_fringe() {
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
