//! A footprint's trapezoid convolved with the mixture of Gaussians by which light spreads under
//! skin.
//!
//! Computed in f32 and for eight borders at once, because a moving scene needs new kernels at each
//! instant. The fraction of light to the left of a border is accurate to 1e-4; most of the error is
//! caused by boxes that are merged into a Gaussian.

use super::super::skin::{Component, MOST, Mixture};
use super::window::{LANES, Window};
use phasmid_core::simd::widest;
use std::f32::consts::{LN_2, LOG2_E};

/// Spread of light under skin along one pattern axis.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spread<'a> {
    pub(crate) mixture: &'a Mixture,
    /// Pattern pixels per millimetre on the surface.
    pub(crate) px_per_mm: f32,
}

impl Spread<'_> {
    /// Returns the weight and the standard deviation in pattern pixels of each Gaussian.
    pub(super) fn parts(&self) -> impl Iterator<Item = [f32; 2]> {
        let part = |c: &Component| [c.weight as f32, c.sigma_mm as f32 * self.px_per_mm];
        self.mixture.components().iter().map(part)
    }

    /// Returns the standard deviation of the widest Gaussian in pattern pixels.
    pub(super) fn widest_px(&self) -> f32 {
        self.parts().map(|[_, sigma]| sigma).fold(0.0, f32::max)
    }
}

/// Minimum ratio of a Gaussian's standard deviation to the width of a box at which the convolution
/// of both is replaced by a Gaussian with the sum of their variances. The resulting error of the
/// fraction of light to the left of a border is at most 8e-5 (from the fourth cumulant of the
/// boxes).
const SMOOTH: f64 = 1.25;
/// Minimum fraction of a kernel that lies on the pattern. Below it, the last pixel gets all the
/// weight.
const BEYOND: f32 = 1e-6;

/// Convolution of two boxes with a mixture of Gaussians, along one pattern axis.
pub(super) struct Blend {
    parts: [Part; MOST],
    len: usize,
    /// Half the base width of the trapezoid, in pattern pixels.
    outer: f64,
}

#[derive(Clone, Copy)]
struct Part {
    weight: f32,
    /// Standard deviation of the part without the boxes, in pattern pixels.
    sigma: f64,
    /// Distance that the part reaches beyond the trapezoid, in pattern pixels.
    reach: f64,
    /// Distance of a border from the centre beyond which all light is taken to lie on one side.
    end: f32,
    /// Inverse standard deviation of the Gaussian into which boxes have been merged.
    per: f32,
    /// Half widths of the boxes that are not merged, times `per`, the wider box first; 0 for a
    /// merged box.
    half: [f32; 2],
}

impl Blend {
    /// Creates the blend of boxes of widths |`slope`|, a blur of standard deviation `sigma` and the
    /// spread under skin. Widths and blur are in projector pixels, the spread in millimetres.
    /// Gaussians narrower than `least` are widened to it.
    pub(super) fn new(slope: [f64; 2], sigma: f64, spread: Spread<'_>, least: f64) -> Self {
        let [a, b] = slope.map(f64::abs);
        let (wide, narrow, outer) = (a.max(b), a.min(b), (a + b) / 2.0);
        let scale = f64::from(spread.px_per_mm);
        let part = |c: &Component| {
            let own = c.sigma_mm * scale;
            let sigma = (own * own + sigma * sigma).sqrt().max(least);
            let merged = [wide, narrow].map(|width| sigma >= SMOOTH * width);
            let variance = |width: f64, merged: bool| match merged {
                true => width * width / 12.0,
                false => 0.0,
            };
            let variance = sigma * sigma + variance(wide, merged[0]) + variance(narrow, merged[1]);
            let per = variance.sqrt().recip();
            let half = |width: f64, merged: bool| match merged {
                true => 0.0,
                false => (width / 2.0 * per) as f32,
            };
            Part {
                weight: c.weight as f32,
                sigma,
                reach: c.reach * sigma,
                end: (outer + c.reach * sigma) as f32,
                per: per as f32,
                half: [half(wide, merged[0]), half(narrow, merged[1])],
            }
        };
        let components = spread.mixture.components();
        let mut parts = [part(&components[0]); MOST];
        for (part_of, c) in parts.iter_mut().zip(components).skip(1) {
            *part_of = part(c);
        }
        Self {
            parts,
            len: components.len(),
            outer,
        }
    }

    fn parts(&self) -> &[Part] {
        &self.parts[..self.len]
    }

    /// Returns half the base width of the trapezoid, and the distance that the blur reaches beyond
    /// it.
    pub(super) fn reach(&self) -> (f64, f64) {
        let reaches = self.parts().iter().map(|part| part.reach);
        (self.outer, reaches.fold(0.0, f64::max))
    }

    /// Returns the standard deviations of the narrowest and the widest part.
    pub(super) fn sigmas(&self) -> [f64; 2] {
        let sigmas = || self.parts().iter().map(|part| part.sigma);
        [
            sigmas().fold(f64::INFINITY, f64::min),
            sigmas().fold(0.0, f64::max),
        ]
    }

    /// Appends the weights of the window's pixels, or groups of pixels, padded with zeros to whole
    /// SIMD blocks.
    pub(super) fn weigh(&self, window: &Window, len: usize, weights: &mut Vec<f32>) {
        weigh(self, window, len, weights);
    }

    /// Returns the fractions of light to the left of borders, given their distances from the centre
    /// in ascending order.
    #[inline(always)]
    fn left_of(&self, e: &Lanes) -> Lanes {
        let mut left = [0.0; LANES];
        for part in self.parts() {
            part.add(e, &mut left);
        }
        left
    }
}

type Lanes = [f32; LANES];

impl Part {
    /// Adds the fractions of light to the left of borders at distances `e0`, `e0 + group` and so on
    /// from the centre: one border for each value in `left` except the last [`LANES`].
    #[inline(always)]
    fn add_run(&self, e0: f32, group: f32, left: &mut [f32]) {
        let borders = left.len() - LANES;
        let place = |e: f32| ((e - e0) / group).ceil().max(0.0).min(borders as f32) as usize;
        let (mut k, last) = (place(-self.end), place(self.end));
        while k < last {
            let mut e = [0.0; LANES];
            for (lane, e) in e.iter_mut().enumerate() {
                *e = e0 + (k + lane) as f32 * group;
            }
            if let Some(left) = left[k..].first_chunk_mut() {
                self.add(&e, left);
            }
            k += LANES;
        }
        if k < borders {
            for left in &mut left[k..borders] {
                *left += self.weight;
            }
        }
    }

    #[inline(always)]
    fn add(&self, e: &Lanes, left: &mut Lanes) {
        if e[0] > self.end {
            for left in left {
                *left += self.weight;
            }
        } else if e[LANES - 1] < -self.end {
        } else if self.half[1] > 0.0 {
            let [wide, narrow] = self.half;
            let (outer, inner) = (wide + narrow, wide - narrow);
            let scale = self.weight * 0.25 / (wide * narrow);
            for k in 0..LANES {
                let z = e[k] * self.per;
                let above = second(z + outer) - second(z + inner);
                let below = second(z - inner) - second(z - outer);
                left[k] += scale * (above - below);
            }
        } else if self.half[0] > 0.0 {
            let half = self.half[0];
            let scale = self.weight * 0.5 / half;
            for k in 0..LANES {
                let z = e[k] * self.per;
                left[k] += scale * (first(z + half) - first(z - half));
            }
        } else {
            for k in 0..LANES {
                left[k] += self.weight * normal(e[k] * self.per).1;
            }
        }
    }
}

widest! {
    fn weigh(blend: &Blend, window: &Window, len: usize, weights: &mut Vec<f32>) => weigh_body
}
#[inline(always)]
fn weigh_body(blend: &Blend, window: &Window, len: usize, weights: &mut Vec<f32>) {
    let Window {
        low,
        high,
        group,
        middle,
        reach,
        ..
    } = *window;
    let beyond_end = len as f64 - middle;
    // Fractions of light to the left of the pattern's two ends.
    let start = if middle > reach {
        0.0
    } else {
        blend.left_of(&[-middle as f32; LANES])[0]
    };
    let end = if beyond_end > reach {
        1.0
    } else {
        blend.left_of(&[beyond_end as f32; LANES])[0]
    };
    let borders = high - low;
    let count = (borders + 1).next_multiple_of(LANES);
    let from = weights.len();
    // The last SIMD block of a run may extend beyond the weights.
    weights.resize(from + count + LANES, 0.0);
    let left = &mut weights[from..];
    if end - start < BEYOND {
        left[borders] = 1.0;
    } else {
        let e0 = ((low + 1) as f64 * group - middle) as f32;
        for part in blend.parts() {
            part.add_run(e0, group as f32, &mut left[..borders + LANES]);
        }
        let scale = (end - start).recip();
        let mut before = start;
        for (block, left) in left[..count].chunks_exact_mut(LANES).enumerate() {
            let mut here = [end; LANES];
            for k in 0..LANES {
                let inside = left[k].max(start).min(end);
                // The last pixel gets all the remaining light.
                here[k] = if block * LANES + k < borders {
                    inside
                } else {
                    end
                };
            }
            left[0] = (here[0] - before) * scale;
            for k in 1..LANES {
                left[k] = (here[k] - here[k - 1]) * scale;
            }
            before = here[LANES - 1];
        }
    }
    weights.truncate(from + count);
}

/// Returns z Phi(z) + phi(z), the antiderivative of the normal distribution Phi.
#[inline(always)]
fn first(z: f32) -> f32 {
    let (density, distribution) = normal(z);
    z * distribution + density
}

/// Returns ((z^2 + 1) Phi(z) + z phi(z)) / 2, the antiderivative of [`first`].
#[inline(always)]
fn second(z: f32) -> f32 {
    let (density, distribution) = normal(z);
    0.5 * ((z * z + 1.0) * distribution + z * density)
}

/// Returns the density phi and the distribution Phi of the normal distribution, Phi with an error
/// below 3e-7 (Abramowitz and Stegun 26.2.17, rounded).
#[inline(always)]
fn normal(z: f32) -> (f32, f32) {
    let x = z.abs();
    let density = 0.398_942_3 * exp2(-0.5 * LOG2_E * x * x);
    let t = 1.0 / (1.0 + 0.231_641_9 * x);
    let series =
        0.319_381_53 + t * (-0.356_563_78 + t * (1.781_477_9 + t * (-1.821_256 + t * 1.330_274_5)));
    let tail = density * t * series;
    (density, if z < 0.0 { tail } else { 1.0 - tail })
}

/// Returns 2^`y` for `y` of at most 0, or 2^-126 for `y` below -126. The Taylor series is evaluated
/// within half an octave of an integer.
#[inline(always)]
fn exp2(y: f32) -> f32 {
    /// Adding this number leaves the nearest integer in the low bits of the sum.
    const WHOLE: f32 = 1.5 * (1u32 << 23) as f32;
    let y = if y > -126.0 { y } else { -126.0 };
    let rounded = y + WHOLE;
    let power = rounded.to_bits().wrapping_sub(WHOLE.to_bits());
    let t = LN_2 * (y - (rounded - WHOLE));
    let series = 1.0
        + t * (1.0
            + t * (0.5 + t * (1.0 / 6.0 + t * (1.0 / 24.0 + t * (1.0 / 120.0 + t / 720.0)))));
    f32::from_bits(series.to_bits().wrapping_add(power << 23))
}

#[cfg(test)]
mod tests {
    use super::super::bell::{Bell, Soft, density, distribution};
    use super::*;
    use crate::skin::Tissue;

    const BOXES: [[f64; 2]; 7] = [
        [0.02, 0.0],
        [0.4, 0.3],
        [1.5, 0.1],
        [1.5, -1.4],
        [4.35, 0.0],
        [12.0, 3.0],
        [1.0, 30.0],
    ];

    fn mixture() -> Mixture {
        Mixture::new(&Tissue {
            absorption_per_mm: 0.02,
            reduced_scattering_per_mm: 2.0,
            refractive_index: 1.4,
        })
    }

    #[test]
    fn the_normal_distribution_is_that_of_the_series() {
        let mut worst = [0.0f64; 2];
        for i in -9000..9000 {
            let z = i as f32 * 1e-3;
            let found = normal(z);
            let z = f64::from(z);
            worst[0] = worst[0].max((f64::from(found.0) - density(z)).abs());
            worst[1] = worst[1].max((f64::from(found.1) - distribution(z)).abs());
        }
        println!("{worst:?}");
        assert!(worst[0] < 1e-7 && worst[1] < 3e-7, "{worst:?}");
        assert!(normal(-1e6).1 < 1e-37 && normal(1e6).1 == 1.0);
        assert!(first(1e4) == 1e4 && first(-1e4).abs() < 1e-30);
    }

    #[test]
    fn the_blend_is_the_sum_of_the_exact_convolutions() {
        let (bell, mixture) = (Bell::new(), mixture());
        let mut worst = 0.0f64;
        for px_per_mm in [0.01, 0.3, 1.0, 3.0, 30.0] {
            for sigma in [0.0, 0.2, 1.7] {
                for slope in BOXES {
                    let spread = Spread {
                        mixture: &mixture,
                        px_per_mm,
                    };
                    let blend = Blend::new(slope, sigma, spread, 1e-2);
                    let (outer, beyond) = blend.reach();
                    for i in -40..=40 {
                        let e = f64::from(i) / 40.0 * (outer + beyond);
                        let exact: f64 = mixture
                            .components()
                            .iter()
                            .map(|c| {
                                let own = c.sigma_mm * f64::from(px_per_mm);
                                let soft = Soft::new(&bell, slope, own.hypot(sigma).max(1e-2));
                                c.weight * soft.left_of(e)
                            })
                            .sum();
                        let found = f64::from(blend.left_of(&[e as f32; LANES])[0]);
                        worst = worst.max((found - exact).abs());
                    }
                }
            }
        }
        println!("{worst:.2e}");
        assert!(worst < 2e-4, "{worst}");
    }

    /// The results are bit-identical: on a machine with AVX2, the AVX2 code is compared with the
    /// code for any x86-64 machine.
    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let mixture = mixture();
        let spread = Spread {
            mixture: &mixture,
            px_per_mm: 3.0,
        };
        for slope in BOXES {
            for x in [-3.0, 0.4, 17.3, 600.2, 1198.9] {
                let blend = Blend::new(slope, 0.4, spread, 1e-3);
                let (outer, beyond) = blend.reach();
                let [narrowest, _] = blend.sigmas();
                let window = Window::new(1200, x, outer, beyond, narrowest);
                let [mut wide, mut narrow] = [const { Vec::new() }; 2];
                weigh(&blend, &window, 1200, &mut wide);
                weigh_body(&blend, &window, 1200, &mut narrow);
                assert_eq!(wide, narrow);
                let sum: f32 = wide.iter().sum();
                assert!((sum - 1.0).abs() < 1e-5, "{slope:?} {x}: {sum}");
            }
        }
    }
}
