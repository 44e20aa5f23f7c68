//! How far the steps of a fringe set contradict each other in a capture as a whole.
//!
//! Four or more steps leave a residual ([`FringeSet::check`](super::FringeSet::check)). It is not
//! noise alone: with four steps a response curve puts its second harmonic there, in proportion to
//! the modulation, and a flickering lamp an error in proportion to the light. Both are everywhere,
//! and so the medians over a capture know them; a damaged pixel of one frame is not.

use super::Options;
use super::phase::{RowNoise, SetKernel};
use super::samples::Sample;
use crate::geometry::NoiseModel;

/// Pixels that are looked at.
const PIXELS: usize = 4000;
/// Fewest of them that tell what is usual.
const FEWEST: usize = 50;
/// How many times the usual a residual may be. A harmonic's |cos| is at most sqrt 2 of its median;
/// the rest is for defocus and light that differ over the image.
const TIMES: f32 = 3.0;
/// Deviations of noise that come on top.
const NOISE: f32 = 7.0;

/// Medians of the residual of a fringe set over a capture.
#[derive(Debug, Clone, Copy)]
pub(super) struct Usual {
    /// Of |residual| / (mean - black).
    light: f32,
    /// Of |residual| / modulation.
    modulation: f32,
}

impl Default for Usual {
    /// Nothing is unusual.
    fn default() -> Self {
        Self {
            light: f32::INFINITY,
            modulation: f32::INFINITY,
        }
    }
}

impl Usual {
    /// The medians of a set over pixels here and there that have fringes and are not saturated.
    pub(super) fn of<T: Sample>(
        set: &SetKernel,
        frames: &[&[T]],
        noise: &NoiseModel,
        saturation: f32,
        options: &Options,
    ) -> Self {
        let Some(first) = set.frames.first().filter(|_| set.checked) else {
            return Self::default();
        };
        let row = RowNoise::new(noise);
        let (mut light, mut modulation) = (Vec::new(), Vec::new());
        // Odd, so that no column of an image is all there is.
        let stride = (frames[*first].len() / PIXELS) | 1;
        for i in (0..frames[*first].len()).step_by(stride) {
            let [a, c, s, check] = set.solve(|frame| frames[frame][i].dn());
            let b = c.hypot(s);
            let from_black = a - row.black;
            let dim = b < options.min_modulation_dn || b < options.min_contrast * from_black;
            if dim || from_black <= 0.0 || a + b >= saturation {
                continue;
            }
            light.push(check.abs() / from_black);
            modulation.push(check.abs() / b);
        }
        if light.len() < FEWEST {
            return Self::default();
        }
        Self {
            light: median(&mut light),
            modulation: median(&mut modulation),
        }
    }

    /// The largest residual in DN that is believed of a pixel of a mean above black and a
    /// modulation.
    #[inline(always)]
    pub(super) fn most(self, light: f32, modulation: f32, noise: RowNoise) -> f32 {
        let usual = (self.light * light).max(self.modulation * modulation);
        // Shot noise is that of the brightest sample at most.
        TIMES * usual + NOISE * noise.variance(noise.black + light + modulation).sqrt()
    }
}

/// The middle value; there is one.
fn median(values: &mut [f32]) -> f32 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}
