//! The error of a coordinate decoded from held projector pixels, as a function of the true one.
//!
//! A projector pixel n shows one level, that of the fringe at its centre. A camera pixel whose
//! footprint is centred on x sees the mean of these levels under its kernel K, a box as wide as the
//! footprint convolved with a Gaussian blur. In phasors, with k = 2 pi / period,
//!
//! Z(x) = sum_n (K * box_n)(x) exp(i k (n - x)) = sum_m a_m exp(2 pi i m x),
//! a_m = sinc(f) sinc(f w) exp(-2 pi^2 f^2 s^2), f = 1 / period + m,
//!
//! by Poisson's summation, where sinc(t) = sin(pi t) / (pi t), w is the width of the footprint and s
//! the standard deviation of the blur, both in projector pixels. The decoded coordinate is
//! x + e(x), e = arg Z / k.

use std::f64::consts::{PI, TAU};

/// Number of intervals per projector pixel.
pub(super) const POINTS: usize = 256;
/// Maximum order m of the harmonics; orders from -m to m are summed. Without blur, a_m falls as 1 / m^2;
/// the omitted harmonics add less than 1e-3 px.
const HARMONICS: i32 = 32;

/// Distances between neighbouring camera pixels for which [`Curve::bend`] is computed, in tenths of the
/// footprint's width. They are smaller than the width along lines on which the coordinate changes more
/// slowly; one is larger because widths are not exact.
const TENTHS: std::ops::RangeInclusive<u8> = 1..=11;

/// Footprint and blur at a node, in projector pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Footprint {
    /// Width along the line.
    pub(super) width: f32,
    /// Standard deviation of the blur, which includes the width across the line.
    pub(super) blur: f32,
}

/// The error e over one projector pixel.
#[derive(Debug)]
pub(super) struct Curve {
    /// In projector pixels at x = 0, 1 / `POINTS`, ... 1; x = 0 is a pixel's centre.
    pub(super) error: [f32; POINTS + 1],
    /// Root mean square of the error in projector pixels.
    pub(super) rms: f32,
    /// Maximum error, in projector pixels, when two camera pixels are extrapolated linearly to the
    /// next.
    pub(super) bend: f32,
}

impl Curve {
    /// Computes the curve for a period, footprint and blur in projector pixels.
    pub(super) fn new(period: f64, width: f64, blur: f64) -> Self {
        let strengths: Vec<_> = (-HARMONICS..=HARMONICS)
            .map(|m| (f64::from(m), strength(period, width, blur, m)))
            .collect();
        let mut error = [0.0; POINTS + 1];
        // The curve is an odd function about the pixel's centre and about its edge, so one half is
        // computed.
        for i in 1..POINTS / 2 {
            let x = i as f64 / POINTS as f64;
            let (mut re, mut im) = (0.0, 0.0);
            for (m, a) in &strengths {
                let (sin, cos) = (TAU * m * x).sin_cos();
                re += a * cos;
                im += a * sin;
            }
            let e = (im.atan2(re) * period / TAU) as f32;
            (error[i], error[POINTS - i]) = (e, -e);
        }
        let sum: f32 = error[..POINTS].iter().map(|e| e * e).sum();
        let rms = (sum / POINTS as f32).sqrt();
        let at = |x: f64| error[(x * POINTS as f64).round().rem_euclid(POINTS as f64) as usize];
        let mut bend = 0f32;
        for apart in TENTHS.map(|tenths| 0.1 * f64::from(tenths) * width) {
            for i in 0..POINTS {
                let x = i as f64 / POINTS as f64;
                let [before, here, after] = [at(x - apart), at(x), at(x + apart)];
                bend = bend.max((after - 2.0 * here + before).abs());
            }
        }
        Self { error, rms, bend }
    }
}

/// The error of a curve at a coordinate, and its slope.
pub(super) fn at(error: &[f32; POINTS + 1], x: f32) -> (f32, f32) {
    let place = (x - x.floor()) * POINTS as f32;
    let i = (place as usize).min(POINTS - 1);
    let step = error[i + 1] - error[i];
    (error[i] + (place - i as f32) * step, step * POINTS as f32)
}

/// Strength a_m of a harmonic.
fn strength(period: f64, width: f64, blur: f64, m: i32) -> f64 {
    let f = period.recip() + f64::from(m);
    sinc(f) * sinc(f * width) * (-2.0 * PI * PI * f * f * blur * blur).exp()
}

fn sinc(t: f64) -> f64 {
    if t == 0.0 {
        1.0
    } else {
        (PI * t).sin() / (PI * t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Computes the error directly from its definition: the phase of the mean phasor of the held
    /// pixels under a box footprint. Blur is modelled as a weighted sum over shifted footprints.
    fn by_definition(period: f64, width: f64, blur: f64, x: f64) -> f64 {
        let (mut re, mut im) = (0.0, 0.0);
        let displaced = (-40..=40).map(|j| f64::from(j) * 0.1);
        for z in displaced.filter(|z| blur > 0.0 || *z == 0.0) {
            let weight = if blur > 0.0 {
                (-0.5 * z * z).exp()
            } else {
                1.0
            };
            let [low, high] = [-0.5, 0.5].map(|end| x + blur * z + end * width);
            let mut n = (low + 0.5).floor();
            while n - 0.5 < high {
                let share = (n + 0.5).min(high) - (n - 0.5).max(low);
                let (sin, cos) = (TAU / period * (n - x)).sin_cos();
                re += weight * share * cos;
                im += weight * share * sin;
                n += 1.0;
            }
        }
        im.atan2(re) * period / TAU
    }

    #[test]
    fn curve_is_the_phase_of_the_mean_of_held_pixels() {
        for period in [8.0, 12.5, 19.0] {
            for (width, blur) in [
                (0.2, 0.0),
                (0.46, 0.0),
                (0.7, 0.15),
                (1.24, 0.0),
                (1.8, 0.1),
                (0.46, 0.3),
                (2.6, 0.0),
            ] {
                let curve = Curve::new(period, width, blur);
                for i in (0..=POINTS).step_by(16) {
                    let x = i as f64 / POINTS as f64;
                    let wanted = by_definition(period, width, blur, x);
                    let found = f64::from(curve.error[i]);
                    // At a pixel's edge without blur the curve jumps, and its value there is arbitrary.
                    let near = (found - wanted).abs() < 3e-3 || i == POINTS / 2;
                    assert!(near, "{period} {width} {blur} at {x}: {found}, {wanted}");
                }
            }
        }
    }

    #[test]
    fn rms_without_blur_is_that_of_a_staircase() {
        // The footprint is much smaller than a pixel: a staircase with an error uniform within half
        // a pixel.
        let rms = Curve::new(16.0, 0.05, 0.0).rms;
        assert!(
            (f64::from(rms) - 12f64.sqrt().recip()).abs() < 0.02,
            "{rms}"
        );
        // Footprints of whole pixels see no staircase.
        assert!(Curve::new(16.0, 1.0, 0.0).rms < 0.02);
        assert!(Curve::new(16.0, 0.5, 0.8).rms < 1e-3);
    }
}
