//! A footprint's trapezoid convolved with a Gaussian blur or a mixture of Gaussians.

use super::super::skin::{MOST, Mixture};
use super::bell::Bell;
use super::bell::Soft;

/// Subsurface spread along one pattern axis.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spread<'a> {
    pub(crate) mixture: &'a Mixture,
    /// Pattern pixels per millimetre on the surface.
    pub(crate) px_per_mm: f32,
}

/// Kernel reach beyond the footprint, in standard deviations. The remainder, 6e-5, is assigned to
/// the last pixel.
const REACH: f64 = 4.0;
/// Beyond this many standard deviations past the footprint the tail of a Gaussian is neglected.
const END: f64 = 6.0;
/// Minimum ratio of a Gaussian's standard deviation to the width of the wider box at which its
/// convolution with both boxes is replaced by a Gaussian with the sum of the variances. The error
/// of the fraction of light left of a border is at most 8e-5 (from the fourth cumulant of the
/// boxes).
const SMOOTH: f64 = 1.25;

/// Convolution of two boxes with a mixture of Gaussians, along one pattern axis.
pub(super) struct Blend<'a> {
    bell: &'a Bell,
    parts: [Part<'a>; MOST],
    len: usize,
}

#[derive(Clone, Copy)]
struct Part<'a> {
    weight: f64,
    soft: Soft<'a>,
    sigma: f64,
    reach: f64,
    /// Distance of a border from the centre beyond which all light is taken to lie on one side.
    end: f64,
    /// Inverse standard deviation of the Gaussian that replaces the convolution with the boxes; 0
    /// if the convolution is not replaced.
    smooth: f64,
}

impl<'a> Blend<'a> {
    /// Creates the blend of boxes of widths |`slope`|, a blur of standard deviation `sigma` and the
    /// spread under skin, all in projector pixels except the spread. Gaussians narrower than
    /// `least` are widened to it.
    pub(super) fn new(
        bell: &'a Bell,
        slope: [f64; 2],
        sigma: f64,
        spread: Option<Spread<'_>>,
        least: f64,
    ) -> Self {
        let part = |weight, sigma: f64, reach| {
            let soft = Soft::new(bell, slope, sigma);
            let end = soft.outer() + END * sigma;
            Part {
                weight,
                soft,
                sigma,
                reach,
                end,
                smooth: 0.0,
            }
        };
        let Some(spread) = spread else {
            return Self {
                bell,
                parts: [part(1.0, sigma, REACH); MOST],
                len: 1,
            };
        };
        let boxes = slope.map(|s| s * s / 12.0);
        let widest = slope[0].abs().max(slope[1].abs());
        let components = spread.mixture.components();
        let scale = f64::from(spread.px_per_mm);
        Self {
            bell,
            parts: std::array::from_fn(|i| {
                let c = components[i.min(components.len() - 1)];
                let sigma = (c.sigma_mm * scale).hypot(sigma).max(least);
                let mut part = part(c.weight, sigma, c.reach);
                part.end = part.soft.outer() + c.reach * sigma;
                if sigma >= SMOOTH * widest {
                    part.smooth = (sigma * sigma + boxes[0] + boxes[1]).sqrt().recip();
                }
                part
            }),
            len: components.len(),
        }
    }

    fn parts(&self) -> &[Part<'a>] {
        &self.parts[..self.len]
    }

    /// Returns half the base width of the trapezoid, and the reach of the blur beyond it.
    pub(super) fn reach(&self) -> (f64, f64) {
        let reach = |part: &Part<'_>| part.reach * part.sigma;
        let outer = |part: &Part<'_>| part.soft.outer();
        (
            self.parts().iter().map(outer).fold(0.0, f64::max),
            self.parts().iter().map(reach).fold(0.0, f64::max),
        )
    }

    /// Returns the standard deviation of the widest part.
    pub(super) fn widest(&self) -> f64 {
        self.parts()
            .iter()
            .map(|part| part.sigma)
            .fold(0.0, f64::max)
    }

    /// Returns the standard deviation of the narrowest part.
    pub(super) fn narrowest(&self) -> f64 {
        let sigmas = self.parts().iter().map(|part| part.sigma);
        sigmas.fold(f64::INFINITY, f64::min)
    }

    /// Returns the fraction of the light left of a border at distance e from the centre.
    pub(super) fn left_of(&self, e: f64) -> f64 {
        self.parts()
            .iter()
            .map(|part| {
                let left = if e > part.end {
                    1.0
                } else if e < -part.end {
                    0.0
                } else if part.smooth > 0.0 {
                    self.bell.second(e * part.smooth)
                } else {
                    part.soft.left_of(e)
                };
                part.weight * left
            })
            .sum()
    }
}
