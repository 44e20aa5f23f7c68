//! Blurred footprints as weights of pattern pixels.
//!
//! A footprint is a trapezoid (see `row_table`), convolved with a Gaussian blur. The fraction of the
//! blurred trapezoid to the left of a border at distance e from its middle is
//!
//! ```text
//! (Q(e + (a+b)/2) - Q(e + (a-b)/2) - Q(e - (a-b)/2) + Q(e - (a+b)/2)) / (a b)
//! ```
//!
//! with Q(e) = sigma^2 G(e / sigma) and G the second antiderivative of the normal distribution
//! (`bell`). The weight of a pattern pixel is the difference between the fractions at its two
//! borders. This is exact. The weights are computed once per scene state, in f64; a frame then needs
//! a sum of a dozen products per pixel. Where light spreads under skin, `blend` computes the
//! fraction in f32.

use super::bell::{Bell, Soft};
use super::blend::{Blend, Spread};
use super::row_table::WIDEST;
use super::window::{GROUPINGS, LANES, Window};
use rayon::prelude::*;
use std::f32::consts::TAU;
use std::sync::Arc;

/// Number of pixels per task and per lookup block.
const BLOCK: usize = 2048;
/// Ratio of blur to footprint width below which blur is ignored: it changes a level by less than
/// 0.05 of 255.
const SHARP: f64 = 2e-4;
/// Minimum standard deviation of a component of the spread, in projector pixels.
const LEAST: f64 = 1e-6;
/// Maximum of the normal distribution.
const NORMAL: f32 = 0.398_942_3;
/// Distance that a kernel reaches beyond the footprint, in standard deviations. The light beyond it,
/// a fraction of 6e-5, is assigned to the last pixel.
const REACH: f64 = 4.0;
/// Distance beyond the footprint, in standard deviations, from which on the tail of a Gaussian is
/// neglected.
const END: f64 = 6.0;

/// The kernels of many footprints, in order.
#[derive(Debug, Clone, Default)]
pub(crate) struct Kernels {
    blocks: Vec<Block>,
    keys: Option<KeyKernels>,
}

/// The kernels at three key instants.
#[derive(Debug, Clone)]
pub(crate) struct KeyKernels {
    pub(crate) kernels: [Arc<Kernels>; 3],
    /// Weights of the levels at the key instants, for each row of the camera.
    pub(crate) weights: Vec<[f32; 3]>,
}

/// A footprint whose level is interpolated between key instants.
#[derive(Debug, Clone, Copy)]
pub(crate) struct KeyFootprint {
    /// Index of the footprint at each key instant.
    pub(crate) indices: [u32; 3],
    /// Row of the camera.
    pub(crate) row: u32,
}

#[derive(Debug, Clone, Default)]
struct Block {
    runs: Vec<Run>,
    weights: Vec<f32>,
    keys: Vec<KeyFootprint>,
}

/// Value of [`Run::len`] for a footprint whose level is the sum over key kernels. [`Run::from`] is its
/// index in [`Block::keys`].
const OF_KEYS: u32 = u32::MAX;

/// Location of the weights of one footprint; `len` is 0 if the footprint is sharp or unlit.
#[derive(Debug, Clone, Copy, Default)]
struct Run {
    /// Index in the block of the first weight.
    from: u32,
    len: u32,
    /// Index of the group of pattern pixels that the first weight belongs to.
    group: u32,
    /// Base-2 logarithm of the number of pattern pixels per group.
    grouping: u32,
}

/// A footprint and its blur.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Blurred<'a> {
    /// Projector coordinate of the footprint's centre in pixels.
    pub(crate) x: f32,
    /// Derivatives of the coordinate with respect to camera column and row.
    pub(crate) slope: [f32; 2],
    /// Standard deviation of the blur in projector pixels; 0 if sharp or unlit.
    pub(crate) sigma: f32,
    /// Spread of light under skin; `None` if the footprint is not on lit skin.
    pub(crate) spread: Option<Spread<'a>>,
}

impl Blurred<'_> {
    /// Returns whether a parabola through the levels at three positions of the footprint,
    /// `distance` pattern pixels apart, is accurate between these positions: at an edge of the
    /// pattern, the parabola's error is at most the effect of a displacement by `tolerance` pattern
    /// pixels.
    ///
    /// The level at an edge is the integral of the kernel k. By Peano's theorem the parabola's error is
    /// at most d max k / 3.17, d^2 max |k'| / 6.64 and d^3 max |k''| / 15.59. A displacement by t changes
    /// the level by up to t max k.
    pub(crate) fn has_parabolic_level(&self, distance: f32, tolerance: f32) -> bool {
        let slopes = self.slope.map(|slope| slope.abs().min(WIDEST));
        let boxes = [slopes[0].max(slopes[1]), slopes[0].min(slopes[1])];
        let [wide, narrow] = boxes.map(f32::recip);
        let square = boxes[0] * boxes[0] + boxes[1] * boxes[1];
        let part = |weight: f32, sigma: f32| {
            let (per, density) = (sigma.recip(), NORMAL * sigma.recip());
            let most = density.min(wide);
            let slope = (0.607 * density * per)
                .min(density * wide)
                .min(wide * narrow);
            let bend = (density * per * per)
                .min(1.213 * density * per * wide)
                .min(2.0 * density * wide * narrow);
            let error = (distance * most / 3.17)
                .min(distance * distance * slope / 6.64)
                .min(distance.powi(3) * bend / 15.59);
            let shift = tolerance / (TAU * sigma * sigma + square).sqrt();
            [weight * error, weight * shift]
        };
        let add = |[a, b]: [f32; 2], [c, d]: [f32; 2]| [a + c, b + d];
        let [error, shift] = match &self.spread {
            None => part(1.0, self.sigma),
            Some(spread) => {
                let parts = spread.parts();
                let parts = parts.map(|[weight, sigma]| part(weight, sigma.hypot(self.sigma)));
                parts.fold([0.0; 2], add)
            }
        };
        error.is_finite() && error <= shift
    }
}

impl Kernels {
    /// Computes the kernels of `count` footprints on a row of `len` pattern pixels.
    ///
    /// `between` returns a footprint of `keys` if the level is interpolated. It needs no kernel then,
    /// unless it is sharp at one of the key instants.
    pub(crate) fn new<'a>(
        count: usize,
        len: usize,
        keys: Option<KeyKernels>,
        between: impl Fn(usize) -> Option<KeyFootprint> + Sync,
        footprint: impl Fn(usize) -> Blurred<'a> + Sync,
    ) -> Self {
        let bell = Bell::new();
        let blurred_between = |k: usize| {
            let (keys, found) = (keys.as_ref()?, between(k)?);
            let mut kernels = keys.kernels.iter().zip(found.indices);
            let all_blur = kernels.all(|(kernels, index)| kernels.blurs(index as usize));
            all_blur.then_some(found)
        };
        let blocks = (0..count.div_ceil(BLOCK))
            .into_par_iter()
            .map_init(Block::default, |block, i| {
                block.runs.clear();
                block.weights.clear();
                block.keys.clear();
                for k in i * BLOCK..((i + 1) * BLOCK).min(count) {
                    match blurred_between(k) {
                        None => block.push(&bell, len, footprint(k)),
                        Some(found) => {
                            block.runs.push(Run {
                                from: block.keys.len() as u32,
                                len: OF_KEYS,
                                ..Run::default()
                            });
                            block.keys.push(found);
                        }
                    }
                }
                // Cloning drops the spare capacity.
                block.clone()
            })
            .collect();
        Self { blocks, keys }
    }

    /// Returns whether the footprint with index `i` has a kernel.
    fn blurs(&self, i: usize) -> bool {
        self.blocks[i / BLOCK].runs[i % BLOCK].len > 0
    }

    /// Returns the average level under the footprint with index `i`; `None` if it has no blur.
    #[inline(always)]
    pub(super) fn average(&self, i: usize, row: &HeldRow) -> Option<f32> {
        let block = &self.blocks[i / BLOCK];
        let run = block.runs[i % BLOCK];
        match (run.len, &self.keys) {
            (0, _) => None,
            (OF_KEYS, Some(keys)) => {
                let found = block.keys[run.from as usize];
                let weights = keys.weights[found.row as usize];
                let mut level = 0.0;
                for k in 0..weights.len() {
                    let index = found.indices[k] as usize;
                    level += weights[k] * keys.kernels[k].own_average(index, row);
                }
                Some(level)
            }
            _ => Some(self.own_average(i, row)),
        }
    }

    /// Returns the average level under the footprint with index `i`, which must have a kernel of its
    /// own.
    #[inline(always)]
    fn own_average(&self, i: usize, row: &HeldRow) -> f32 {
        let block = &self.blocks[i / BLOCK];
        let run = block.runs[i % BLOCK];
        let weights = &block.weights[run.from as usize..][..run.len as usize];
        let levels = &row.groupings[run.grouping as usize][run.group as usize..];
        dot(weights, levels)
    }
}

impl Block {
    fn push(&mut self, bell: &Bell, len: usize, footprint: Blurred<'_>) {
        let boxes = footprint
            .slope
            .map(|slope| f64::from(slope.abs().min(WIDEST)));
        let sigma = f64::from(footprint.sigma);
        let sharp = SHARP * boxes[0].max(boxes[1]);
        let from = self.weights.len();
        let window = match footprint.spread {
            None if sigma.is_nan() || sigma <= sharp => None,
            None => {
                let soft = Soft::new(bell, boxes, sigma);
                let window = Window::new(len, footprint.x, soft.outer(), REACH * sigma, sigma);
                self.weigh(&window, len, &soft, soft.outer() + END * sigma);
                Some(window)
            }
            Some(spread) => {
                // Some components of a spread may be sharp.
                let blend = Blend::new(boxes, sigma, spread, sharp.max(LEAST));
                let (outer, beyond) = blend.reach();
                let [narrowest, widest] = blend.sigmas();
                (!beyond.is_nan() && widest > sharp).then(|| {
                    let window = Window::new(len, footprint.x, outer, beyond, narrowest);
                    blend.weigh(&window, len, &mut self.weights);
                    window
                })
            }
        };
        self.runs
            .push(window.map_or_else(Run::default, |window| Run {
                from: from as u32,
                len: (self.weights.len() - from) as u32,
                group: window.low as u32,
                grouping: window.grouping as u32,
            }));
    }

    /// Appends the weights of the window's pixels or groups under a trapezoid with Gaussian blur.
    /// All light is taken to lie on one side of a border that is further than `beyond` from the
    /// centre.
    fn weigh(&mut self, window: &Window, len: usize, soft: &Soft<'_>, beyond: f64) {
        let left_of = |e: f64| {
            if e > beyond {
                1.0
            } else if e < -beyond {
                0.0
            } else {
                soft.left_of(e)
            }
        };
        let from = self.weights.len();
        // The geometry pass accounts for the part of the footprint beyond the pattern's ends, so the
        // kernel is the mean over the part inside.
        let (start, end) = (left_of(-window.middle), left_of(len as f64 - window.middle));
        // Only the last pixel gets weight if the kernel lies far beyond an end of the pattern.
        let part = (end - start).max(1e-9);
        let mut before = start;
        for i in window.low..window.high {
            let left = left_of((i + 1) as f64 * window.group - window.middle).clamp(start, end);
            self.weights.push(((left - before) / part) as f32);
            before = left;
        }
        let rest: f32 = self.weights[from..].iter().sum();
        self.weights.push(1.0 - rest);
        let count = (self.weights.len() - from).next_multiple_of(LANES);
        self.weights.resize(from + count, 0.0);
    }
}

/// A pattern row for kernels: the light of each pixel, and the mean light of groups of pixels.
pub(crate) struct HeldRow {
    groupings: Vec<Vec<f32>>,
}

impl HeldRow {
    /// Creates a row from the `light` of each of its pixels, relative to full white.
    pub(super) fn new(light: &[f64]) -> Self {
        let last = light.last().copied().unwrap_or(0.0);
        let mut means = light.to_vec();
        let groupings = (0..GROUPINGS)
            .map(|_| {
                let mut row: Vec<f32> = means.iter().map(|&mean| mean as f32).collect();
                // The weights of a kernel are padded with zeros to whole SIMD blocks, so pad the row
                // as well.
                row.resize(row.len() + LANES, last as f32);
                means = means
                    .chunks(2)
                    .map(|pair| (pair[0] + pair.get(1).unwrap_or(&last)) / 2.0)
                    .collect();
                row
            })
            .collect();
        Self { groupings }
    }

    /// Returns the light of each pixel, then the mean light of each group of 2, of 4 and so on.
    pub(crate) fn groupings(&self) -> &[Vec<f32>] {
        &self.groupings
    }

    /// Returns the memory size of the row in bytes.
    pub(super) fn bytes(&self) -> usize {
        self.groupings
            .iter()
            .map(|g| size_of_val(g.as_slice()))
            .sum()
    }
}

#[inline(always)]
fn dot(weights: &[f32], levels: &[f32]) -> f32 {
    let mut sums = [0.0f32; LANES];
    for (w, l) in weights.chunks_exact(LANES).zip(levels.chunks_exact(LANES)) {
        for k in 0..LANES {
            sums[k] += w[k] * l[k];
        }
    }
    let [a, b, c, d, e, f, g, h] = sums;
    ((a + e) + (b + f)) + ((c + g) + (d + h))
}

#[cfg(test)]
mod tests {
    use super::super::bell::distribution;
    use super::*;

    fn blurred(x: f32, slope: [f32; 2], sigma: f32) -> Blurred<'static> {
        Blurred {
            x,
            slope,
            sigma,
            spread: None,
        }
    }

    fn no_keys(_: usize) -> Option<KeyFootprint> {
        None
    }

    /// Reference for the mean of a blurred row over the footprint. It uses the midpoint rule over
    /// the trapezoid: for each position, it sums the integral of the Gaussian over each pixel times
    /// the pixel's level, normalised to the part on the pattern.
    fn integrated(levels: &[f64], footprint: Blurred<'_>) -> f64 {
        let [a, b] = footprint.slope.map(|s| f64::from(s.abs()));
        let sigma = f64::from(footprint.sigma);
        let (wide, narrow) = (a.max(b), a.min(b));
        let outer = (wide + narrow) / 2.0;
        let places = (40.0 * 2.0 * outer / sigma).clamp(400.0, 40_000.0) as usize;
        let (mut sum, mut total) = (0.0, 0.0);
        for i in 0..places {
            let offset = ((i as f64 + 0.5) / places as f64 - 0.5) * 2.0 * outer;
            let weight = ((outer - offset.abs()) / narrow).min(1.0);
            let x = f64::from(footprint.x) + offset;
            let near = |p: f64| (p.max(0.0) as usize).min(levels.len() - 1);
            let (low, high) = (near(x - 7.0 * sigma), near(x + 7.0 * sigma + 1.0));
            let border = |j: usize| distribution((j as f64 - 0.5 - x) / sigma);
            let (mut mean, mut before) = (0.0, border(low));
            for (j, level) in levels.iter().enumerate().take(high + 1).skip(low) {
                let left = border(j + 1);
                mean += level * (left - before);
                total += weight * (left - before);
                before = left;
            }
            sum += weight * mean;
        }
        sum / total
    }

    #[test]
    fn kernels_agree_with_direct_integration() {
        let stripes: Vec<f64> = (0..1200).map(|i| f64::from(i / 3 % 2)).collect();
        let edge: Vec<f64> = (0..1200).map(|i| f64::from(u8::from(i >= 603))).collect();
        let mut worst = 0.0f64;
        for row in [stripes, edge] {
            let held = HeldRow::new(&row);
            for sigma in [0.02, 0.3, 0.57, 0.86, 2.5, 17.0, 48.1, 100.0] {
                for slope in [
                    [0.02, 0.0],
                    [0.4, 0.3],
                    [4.35, 0.0],
                    [4.35, -4.0],
                    [1.0, 30.0],
                ] {
                    for x in [0.2, 599.9, 602.3, 602.5, 603.7, 1199.0] {
                        // Near an end of the pattern the tolerance is larger where pixels are
                        // grouped, which is from this sigma on.
                        let near_end = !(1.0..1198.0).contains(&x);
                        let bar = if near_end && sigma >= 96.0 { 0.5 } else { 0.05 };
                        let footprint = blurred(x, slope, sigma);
                        let kernels = Kernels::new(1, row.len(), None, no_keys, |_| footprint);
                        let level = f64::from(kernels.average(0, &held).unwrap());
                        let error = 255.0 * (level - integrated(&row, footprint)).abs();
                        worst = worst.max(error);
                        assert!(error < bar, "{footprint:?}: {error}");
                    }
                }
            }
        }
        assert!(worst > 1e-6, "{worst}");
    }

    #[test]
    fn a_blurred_cosine_has_the_contrast_of_the_closed_form() {
        // Averaging over pattern pixels attenuates a cosine of period P by sinc(1/P), the footprint
        // by sinc(a/P) sinc(b/P), and the Gaussian by exp(-2 pi^2 sigma^2 / P^2).
        let period = 24.0;
        let phase = |x: f64| std::f64::consts::TAU * x / period;
        let row: Vec<f64> = (0..960)
            .map(|i| 0.5 + 0.5 * phase(f64::from(i)).cos())
            .collect();
        let held = HeldRow::new(&row);
        let sinc = |w: f64| (phase(w) / 2.0).sin() / (phase(w) / 2.0);
        for sigma in [0.4, 1.7, 3.0, 5.0] {
            let slope = [3.1, 1.2];
            let spread = f64::from(sigma);
            let contrast = sinc(1.0)
                * sinc(f64::from(slope[0]))
                * sinc(f64::from(slope[1]))
                * (-0.5 * (phase(spread)).powi(2)).exp();
            let mut sums = [0.0; 3];
            for i in 0..240 {
                let x = 400.0 + i as f32 * 0.1;
                let kernels = Kernels::new(1, 960, None, no_keys, |_| blurred(x, slope, sigma));
                let level = f64::from(kernels.average(0, &held).unwrap());
                sums[0] += level / 240.0;
                sums[1] += level * phase(x.into()).cos() / 120.0;
                sums[2] += level * phase(x.into()).sin() / 120.0;
            }
            assert!((sums[0] - 0.5).abs() < 1e-5, "{}", sums[0]);
            assert!(
                (sums[1] - 0.5 * contrast).abs() < 1e-5,
                "{sigma} {}",
                sums[1]
            );
            assert!(sums[2].abs() < 1e-5);
        }
    }

    /// At the largest distance at which levels are interpolated, the error is at most the effect of
    /// a displacement by the tolerance, for footprints with much blur and with hardly any. A footprint
    /// that is sharp at a key instant gets a kernel of its own.
    #[test]
    fn levels_between_key_instants_are_interpolated() {
        let row: Vec<f64> = (0..120).map(|i| f64::from(u8::from(i >= 44))).collect();
        let held = HeldRow::new(&row);
        let first = KeyFootprint {
            indices: [0; 3],
            row: 0,
        };
        let kernel = |footprint| Arc::new(Kernels::new(1, 120, None, no_keys, |_| footprint));
        let tolerance = 0.01;
        for (slope, sigma) in [
            ([1.3, 0.1], 0.2),
            ([1.3, 0.1], 0.001),
            ([1.0, 0.02], 0.1),
            ([1.0, -0.02], 0.01),
            ([0.4, 0.4], 0.02),
            ([0.7, 0.3], 1.5),
        ] {
            let at = |x: f32| blurred(x, slope, sigma);
            let distances = (0..200).map(|k| 2.0 * 0.97f32.powi(k));
            let distance = distances
                .into_iter()
                .find(|distance| at(40.0).has_parabolic_level(*distance, tolerance));
            let distance = distance.unwrap();
            let level = |x: f32| kernel(at(x)).average(0, &held).unwrap();
            let (mut worst, mut effect) = (0.0f32, 0.0f32);
            for i in 0..800 {
                let x = 40.0 + i as f32 * 0.01;
                effect = effect.max((level(x + tolerance) - level(x)).abs());
                for s in [-1.0f32, -0.7, 0.2, 0.5] {
                    let keys = KeyKernels {
                        kernels: [-1.0, 0.0, 1.0].map(|k| kernel(at(x + k * distance))),
                        weights: vec![[0.5 * s * (s - 1.0), 1.0 - s * s, 0.5 * s * (s + 1.0)]],
                    };
                    let between = Kernels::new(
                        1,
                        120,
                        Some(keys),
                        |_| Some(first),
                        |_| unreachable!("the level is interpolated"),
                    );
                    let found = between.average(0, &held).unwrap();
                    worst = worst.max((found - level(x + s * distance)).abs());
                }
            }
            println!("{slope:?} {sigma}: {distance} {}", worst / effect);
            assert!(worst < effect, "{slope:?} {sigma} {worst} {effect}");
            assert!(worst > 0.1 * effect, "{slope:?} {sigma} {worst} {effect}");
        }
        let slope = [1.3, 0.1];
        let single = |x: f32, sigma: f32| kernel(blurred(x, slope, sigma));
        let keys = KeyKernels {
            kernels: [single(50.0, 0.2), single(50.0, 0.2), single(50.0, 0.0)],
            weights: vec![[0.0, 0.0, 1.0]],
        };
        let own = Kernels::new(
            1,
            120,
            Some(keys),
            |_| Some(first),
            |_| blurred(50.0, slope, 0.2),
        );
        assert_eq!(own.average(0, &held), single(50.0, 0.2).average(0, &held));
    }

    #[test]
    fn white_stays_white_and_sharp_footprints_have_no_kernel() {
        let held = HeldRow::new(&[1.0; 77]);
        for sigma in [1e-3, 1.0, 33.0, 1e4, 1e9] {
            for x in [-900.0, 0.0, 76.0, 1e5] {
                for slope in [[0.0, 0.0], [2.0, 1.0], [1e9, f32::INFINITY]] {
                    let kernels = Kernels::new(1, 77, None, no_keys, |_| blurred(x, slope, sigma));
                    let level = kernels.average(0, &held).unwrap_or(1.0);
                    assert!((level - 1.0).abs() < 1e-5, "{sigma} {x} {slope:?} {level}");
                }
            }
        }
        for sigma in [0.0, 1e-5, f32::NAN] {
            let slope = [1.0, 0.2];
            let kernels = Kernels::new(1, 77, None, no_keys, |_| blurred(3.0, slope, sigma));
            assert!(kernels.average(0, &held).is_none());
        }
    }
}
