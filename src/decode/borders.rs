//! Rejects untrusted border pixels. A border pixel lies beside a depth step, or beside a pixel without a
//! coordinate.
//!
//! [`super::edges`] finds mixed pixels by their coordinate alone. This can fail at the last pixel of a
//! slanted or curved flank: that pixel has only one side to extrapolate from, and a flank that steepens
//! looks like a mixture. Therefore two physical facts decide about border pixels once mixed pixels have
//! been removed:
//!
//! - *Beside a step* between two valid pixels, an edge runs through one of the two, or between them.
//!   Each of the two pixels may be a mixture of two lit surfaces, so neither is trusted. A step is a
//!   difference that neither side's slope explains: it lies outside the range of the two slopes by more
//!   than the noise and half the steeper slope (a crease turns from one slope to the other and stays
//!   within).
//! - *Beside a hole* (unlit, dim, or removed) a pixel may be lit or covered in part. It then averages
//!   over the lit part f of its footprint only, and if the edge runs across the line of pixels, its
//!   coordinate is off by (1 - f) / 2 times the slope along the line. The pixel's brightness divided by
//!   the brightness of its inner neighbour is a lower bound of f; if the surface darkens outwards, the
//!   bound is too low and the test is stricter than necessary. A pixel stays only if the resulting upper
//!   bound of its bias is below its noise. Where the coordinate does not change along the line, there is
//!   no bias and the pixel stays.

use super::edges::{KEEP, MIXED, less};
use phasmid_geometry::NoiseModel;

/// Noise margin in standard deviations: 5 sqrt(6), as for extrapolations in [`super::edges`].
const STEP: f32 = 12.25;
/// A bias below this many standard deviations is hidden by noise.
const BIAS: f32 = 3.0;
/// Minimum tolerance in projector pixels: far below relevant errors, above the f32 rounding of large
/// coordinates.
const FLOOR_PX: f32 = 0.02;

/// Noise of the intensity map: its variance is `floor + slope * intensity`.
#[derive(Debug, Clone, Copy)]
pub(super) struct LightNoise {
    pub(super) floor: f32,
    pub(super) slope: f32,
}

impl LightNoise {
    /// Creates the noise model of the intensity map, which is (white - black) / `range`, with `range` in
    /// DN. The noise of ambient light is not modelled, so ambient light makes the test stricter.
    pub(super) fn new(noise: &NoiseModel, range: f32) -> Self {
        let dark = noise.variance_dn2(noise.black_level_dn) as f32;
        Self {
            floor: 2.0 * dark / (range * range),
            slope: noise.gain_dn_per_e as f32 / range,
        }
    }
}

/// The maps around the judged row v; all rows have the same length, and rows outside the image are NaN.
pub(super) struct Near<'a> {
    /// Coordinates of rows v - 2 to v + 2.
    pub(super) rows: [&'a [f32]; 5],
    /// Row v with two NaN on either side.
    pub(super) padded: &'a [f32],
    /// Intensities of rows v - 1 to v + 1.
    pub(super) light: [&'a [f32]; 3],
    /// Intensities of row v with one NaN on either side.
    pub(super) padded_light: &'a [f32],
    /// Standard deviations of row v.
    pub(super) sigma: &'a [f32],
    /// Variance of the coordinate due to model errors of the samples (rounded levels), in projector
    /// pixels^2.
    pub(super) model: f32,
    /// Maximum error that held projector pixels cause in an extrapolation to each pixel of row v.
    pub(super) held: &'a [f32],
    pub(super) noise: LightNoise,
}

/// Writes [`MIXED`] into `flags` at rejected border pixels; coordinates are known modulo `period`, which
/// is 0 if they are absolute.
#[inline(always)]
pub(super) fn judge_row(near: &Near<'_>, period: f32, flags: &mut [u8]) {
    if period > 0.0 {
        judge::<true>(near, period, flags);
    } else {
        judge::<false>(near, 1.0, flags);
    }
}

#[inline(always)]
fn judge<const WRAPPED: bool>(near: &Near<'_>, period: f32, flags: &mut [u8]) {
    let n = flags.len();
    let h = |k: usize| &near.padded[k..k + n];
    let (l2, l1, r1, r2) = (h(0), h(1), h(3), h(4));
    let [u2, u1, row, d1, d2] = near.rows.map(|row| &row[..n]);
    let [up, light, down] = near.light.map(|row| &row[..n]);
    let (left, right) = (&near.padded_light[..n], &near.padded_light[2..n + 2]);
    let (sigma, held) = (&near.sigma[..n], &near.held[..n]);
    for i in 0..n {
        let x = row[i];
        let sigma = (sigma[i] * sigma[i] + near.model).sqrt();
        // Standard deviation of the intensity: a drop within it is not significant.
        let sd = (near.noise.floor + near.noise.slope * light[i]).sqrt();
        let here = Pixel {
            x,
            light: light[i] + BIAS * sd,
            step: STEP * sigma + FLOOR_PX + held[i],
            bias: BIAS * sigma + FLOOR_PX,
        };
        let ([a, b], [c, d]) = ([l1[i], l2[i]], [r1[i], r2[i]]);
        let ([e, f], [g, k]) = ([u1[i], u2[i]], [d1[i], d2[i]]);
        let bad = here.borders::<WRAPPED>([a, b], [c, d], left[i], right[i], period)
            | here.borders::<WRAPPED>([c, d], [a, b], right[i], left[i], period)
            | here.borders::<WRAPPED>([e, f], [g, k], up[i], down[i], period)
            | here.borders::<WRAPPED>([g, k], [e, f], down[i], up[i], period);
        flags[i] = if bad & !x.is_nan() { MIXED } else { KEEP };
    }
}

/// A pixel, with the tolerances of the step test and of the bias test.
struct Pixel {
    x: f32,
    light: f32,
    step: f32,
    bias: f32,
}

impl Pixel {
    /// Returns whether the pixel fails towards its outer side. `outer` and `inner` list the nearest
    /// pixel first; NaN marks a missing pixel.
    #[inline(always)]
    fn borders<const WRAPPED: bool>(
        &self,
        inner: [f32; 2],
        outer: [f32; 2],
        inner_light: f32,
        outer_light: f32,
        period: f32,
    ) -> bool {
        // All slopes point outwards.
        let across = less::<WRAPPED>(outer[0], self.x, period);
        let own = less::<WRAPPED>(self.x, inner[0], period);
        let before = less::<WRAPPED>(inner[0], inner[1], period);
        let beyond = less::<WRAPPED>(outer[1], outer[0], period);
        // f32::min and f32::max ignore a NaN: if one slope is unknown, the other decides. If both are
        // unknown, nothing counts as a step.
        let steeper = own.abs().max(beyond.abs());
        let allow = self.step + 0.5 * steeper;
        let step = (across < own.min(beyond) - allow) | (across > own.max(beyond) + allow);
        // The image border is not a hole.
        let hole = outer[0].is_nan() & !outer_light.is_nan();
        let slope = own.abs().max(before.abs());
        let drop = inner_light - self.light;
        step | (hole & (0.5 * slope * drop > self.bias * inner_light))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: f32 = f32::NAN;

    fn flags(x: &[f32], light: &[f32], sigma: f32, period: f32) -> Vec<u8> {
        let nan = vec![N; x.len()];
        let pad = |row: &[f32], by: usize| {
            let ends = vec![N; by];
            [&ends[..], row, &ends[..]].concat()
        };
        let near = Near {
            rows: [&nan, &nan, x, &nan, &nan],
            padded: &pad(x, 2),
            light: [&nan, light, &nan],
            padded_light: &pad(light, 1),
            sigma: &vec![sigma; x.len()],
            model: 0.0,
            held: &vec![0.0; x.len()],
            noise: LightNoise {
                floor: 1e-5,
                slope: 1e-4,
            },
        };
        let mut flags = vec![KEEP; x.len()];
        judge_row(&near, period, &mut flags);
        flags
    }

    #[test]
    fn removes_both_sides_of_a_step_and_keeps_creases() {
        // A flank that steepens towards its silhouette, then the surface behind it.
        let x = [
            1654.0, 1659.3, 1665.0, 1671.4, 1677.8, 1840.7, 1845.0, 1849.3,
        ];
        let light = [0.5; 8];
        assert_eq!(flags(&x, &light, 0.02, 0.0), [0, 0, 0, 0, 1, 1, 0, 0]);
        let crease = [0.0, 1.0, 2.0, 3.0, 5.5, 11.5, 18.5, 25.5];
        assert_eq!(flags(&crease, &light, 0.02, 0.0), [KEEP; 8]);
        let wrapped = [0.0f32, 4.0, 8.0, 12.0, 16.0, 20.0, 24.0, 28.0].map(|v| v % 16.0);
        assert_eq!(flags(&wrapped, &light, 0.02, 16.0), [KEEP; 8]);
    }

    #[test]
    fn removes_partly_lit_pixels_where_they_are_biased() {
        let lit = [0.4, 0.4, 0.4, 0.4, 0.2, 0.0];
        let x = [0.0, 4.0, 8.0, 12.0, 15.0, N];
        assert_eq!(flags(&x, &lit, 0.02, 0.0), [0, 0, 0, 0, 1, 0]);
        // Fully lit up to the end.
        let whole = [0.4, 0.4, 0.4, 0.4, 0.39, 0.0];
        assert_eq!(flags(&x, &whole, 0.02, 0.0), [KEEP; 6]);
        // The last lit pixel is only half lit, but the coordinate hardly changes along the line, so the
        // pixel has no bias.
        let along = [7.0, 7.0, 7.01, 7.0, 7.01, N];
        assert_eq!(flags(&along, &lit, 0.02, 0.0), [KEEP; 6]);
        // At the image border the surface darkens, but the pixel is not lit in part.
        assert_eq!(flags(&x[..5], &lit[..5], 0.02, 0.0), [KEEP; 5]);
    }
}
