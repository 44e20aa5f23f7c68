//! Gray code: finds the frames that form a complete code, and decodes the bits of a row of pixels.
//!
//! Bit b of the reflected code of floor(x / cell) changes at odd multiples of w = cell 2^b and
//! nowhere else, so w alone identifies a bit: bit 0 of cells of 8 px is the bit below bit 0 of cells
//! of 16 px. A complementary bit (one finer bit, so that a code edge never coincides with a phase
//! wrap; Zhang et al. 2017 call the complete code complementary Gray code) joins a code in this way.
//! It works for any number of codes whose cell widths are related by powers of two.

use super::sample::Sample;
use phasmid_core::error::{Error, Result};
use phasmid_pattern::Axis;

/// The frames of one bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct GrayBit {
    /// Frame that shows the bit.
    pub plain: Option<usize>,
    /// Frame that shows the bit's complement.
    pub inverse: Option<usize>,
}

/// A complete code, from its cell width up to the whole axis.
#[derive(Debug, Clone, PartialEq)]
pub struct GrayCode {
    /// Cell width in projector pixels.
    pub cell_px: f64,
    /// Bits, least significant first.
    pub bits: Vec<GrayBit>,
}

/// One Gray frame of a manifest.
#[derive(Debug, Clone, Copy)]
pub(super) struct GrayFrame {
    pub(super) frame: usize,
    pub(super) cell_px: f64,
    pub(super) bit: u32,
    pub(super) inverted: bool,
}

/// The finest complete code that the frames contain for an axis.
pub(super) struct Found {
    pub(super) code: Option<GrayCode>,
    /// Name of the missing bit that makes the finest cells unusable, for messages.
    pub(super) missing: Option<String>,
}

pub(super) fn find(axis: Axis, extent_px: f64, frames: &[GrayFrame]) -> Found {
    // Bits by the width w that identifies them.
    let mut bits: Vec<(f64, GrayBit)> = Vec::new();
    for f in frames {
        let w = f.cell_px * f64::from(f.bit).exp2();
        let same = bits.iter().position(|(v, _)| (v / w - 1.0).abs() < 1e-6);
        let at = same.unwrap_or_else(|| {
            bits.push((w, GrayBit::default()));
            bits.len() - 1
        });
        let slot = if f.inverted {
            &mut bits[at].1.inverse
        } else {
            &mut bits[at].1.plain
        };
        slot.get_or_insert(f.frame);
    }
    bits.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut missing = None;
    for &(cell_px, _) in &bits {
        let mut chain = Vec::new();
        let mut w = cell_px;
        let complete = loop {
            match bits.iter().find(|(v, _)| (v / w - 1.0).abs() < 1e-5) {
                Some((_, bit)) => chain.push(*bit),
                None => break false,
            }
            w *= 2.0;
            if w >= extent_px * (1.0 - 1e-9) {
                break true;
            }
        };
        if complete {
            let code = Some(GrayCode {
                cell_px,
                bits: chain,
            });
            return Found { code, missing };
        }
        missing.get_or_insert_with(|| {
            format!(
                "Gray bit {} of the cells of {cell_px} px on axis {axis}",
                chain.len()
            )
        });
    }
    Found {
        code: None,
        missing,
    }
}

/// How to convert a bit's sample to a signed contrast, positive for a set bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Threshold {
    /// Half the difference from the complement.
    Complement,
    /// Compared with the mean of white and black.
    Reference,
    /// Compared with the mean of the fringes.
    Fringes,
}

impl Threshold {
    /// Ratio of the variance of the contrast to that of one sample. `steps` is the number of frames in
    /// the fringes' mean.
    pub(super) fn variance_factor(self, steps: usize) -> f64 {
        match self {
            Self::Complement => 0.5,
            Self::Reference => 1.5,
            Self::Fringes => 1.0 + 1.0 / steps.max(1) as f64,
        }
    }
}

/// Chooses the threshold of a bit.
///
/// # Errors
/// Returns an error if there is no threshold for the bit.
pub(super) fn threshold(
    axis: Axis,
    bit: GrayBit,
    references: bool,
    fringes: bool,
) -> Result<Threshold> {
    match bit {
        GrayBit {
            plain: Some(_),
            inverse: Some(_),
        } => Ok(Threshold::Complement),
        _ if references => Ok(Threshold::Reference),
        _ if fringes => Ok(Threshold::Fringes),
        _ => Err(Error::input(
            format!("sequence, axis {axis}"),
            "a Gray bit without a threshold: no complement, no white and black, no fringes",
            "complements of the Gray bits, or a white and a black frame",
        )),
    }
}

/// Gray code words of a row of pixels, with their two weakest contrasts.
#[derive(Debug, Default)]
pub(super) struct GrayRow {
    /// The code word in the low bits; the index of its weakest bit from [`WEAKEST`] upwards.
    pub(super) code: Vec<u32>,
    /// Absolute contrast of the weakest bit, in DN.
    pub(super) margin: Vec<f32>,
    /// Absolute contrast of the second weakest bit, in DN.
    pub(super) second: Vec<f32>,
}

impl GrayRow {
    pub(super) fn reset(&mut self, n: usize) {
        self.code.clear();
        self.code.resize(n, 0);
        for v in [&mut self.margin, &mut self.second] {
            v.clear();
            v.resize(n, f32::INFINITY);
        }
    }

    /// Adds a bit with a complement: the samples of the two frames differ by twice the contrast.
    #[inline(always)]
    pub(super) fn add_pair<T: Sample>(&mut self, bit: usize, plain: &[T], inverse: &[T]) {
        let n = self.code.len();
        let (plain, inverse) = (&plain[..n], &inverse[..n]);
        let code = &mut self.code[..n];
        let (margin, second) = (&mut self.margin[..n], &mut self.second[..n]);
        for i in 0..n {
            let d = 0.5 * (plain[i].dn() - inverse[i].dn());
            note(bit, d, &mut code[i], &mut margin[i], &mut second[i]);
        }
    }

    /// Adds a bit against a threshold; `sign` is -1 for a frame that shows the complement.
    #[inline(always)]
    pub(super) fn add_single<T: Sample>(
        &mut self,
        bit: usize,
        frame: &[T],
        threshold: &[f32],
        sign: f32,
    ) {
        let n = self.code.len();
        let (frame, threshold) = (&frame[..n], &threshold[..n]);
        let code = &mut self.code[..n];
        let (margin, second) = (&mut self.margin[..n], &mut self.second[..n]);
        for i in 0..n {
            let d = sign * (frame[i].dn() - threshold[i]);
            note(bit, d, &mut code[i], &mut margin[i], &mut second[i]);
        }
    }
}

/// Position, in a word of [`GrayRow::code`], of the lowest bit of the index of the weakest bit.
const WEAKEST: u32 = 24;
const CODE: u32 = (1 << WEAKEST) - 1;

/// Adds a bit of contrast `d`. The weakest bit's index shares a word with the code, so that the store
/// is unconditional; a masked store costs more than the rest of the loop on some machines.
#[inline(always)]
fn note(bit: usize, d: f32, code: &mut u32, margin: &mut f32, second: &mut f32) {
    let size = d.abs();
    let word = if size < *margin {
        (*code & CODE) | ((bit as u32) << WEAKEST)
    } else {
        *code
    };
    *code = word | (u32::from(d > 0.0) << bit);
    *second = second.min(margin.max(size));
    *margin = margin.min(size);
}

/// Returns the cell of a code word, and the cell that it would have if its weakest bit were inverted.
#[inline(always)]
pub(super) fn cells(word: u32) -> (u32, u32) {
    let code = word & CODE;
    (decode32(code), decode32(code ^ (1 << (word >> WEAKEST))))
}

/// Decodes a reflected Gray code of at most 32 bits, branch-free.
#[inline(always)]
fn decode32(code: u32) -> u32 {
    let mut n = code;
    n ^= n >> 1;
    n ^= n >> 2;
    n ^= n >> 4;
    n ^= n >> 8;
    n ^ (n >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_pattern::gray_decode;

    fn frames(codes: &[(f64, u32)], without: Option<(f64, u32)>) -> Vec<GrayFrame> {
        let mut all = Vec::new();
        for &(cell_px, bits) in codes {
            for bit in (0..bits).filter(|&b| without != Some((cell_px, b))) {
                all.push(GrayFrame {
                    frame: all.len(),
                    cell_px,
                    bit,
                    inverted: false,
                });
            }
        }
        all
    }

    #[test]
    fn a_finer_bit_joins_a_code_of_whole_cells() {
        let mut list = frames(&[(16.0, 7)], None);
        list.push(GrayFrame {
            frame: 7,
            cell_px: 8.0,
            bit: 0,
            inverted: false,
        });
        let code = find(Axis::X, 1920.0, &list).code.unwrap();
        assert_eq!((code.cell_px, code.bits.len()), (8.0, 8));
        let order: Vec<_> = code.bits.iter().map(|b| b.plain.unwrap()).collect();
        assert_eq!(order, [7, 0, 1, 2, 3, 4, 5, 6]);
    }

    #[test]
    fn missing_bit_leaves_the_coarser_code_and_is_named() {
        let found = find(Axis::X, 1920.0, &frames(&[(16.0, 7)], Some((16.0, 3))));
        let code = found.code.unwrap();
        assert_eq!((code.cell_px, code.bits.len()), (256.0, 3));
        assert!(
            found
                .missing
                .unwrap()
                .starts_with("Gray bit 3 of the cells of 16 px on axis x")
        );
        let found = find(Axis::Y, 1920.0, &frames(&[(16.0, 7)], Some((16.0, 6))));
        assert!(found.code.is_none());
        assert!(found.missing.unwrap().starts_with("Gray bit 6"));
    }

    #[test]
    fn decode32_is_the_reflected_code() {
        for n in (0..1u32 << 20).step_by(37) {
            assert_eq!(decode32(n), gray_decode(u64::from(n)) as u32);
        }
    }
}
