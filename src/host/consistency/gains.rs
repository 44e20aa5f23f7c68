//! The light of each step of a fringe set against that of the others.
//!
//! Steps k of one set see `A + B cos(phi + delta_k)`, times a gain `g_k` that is 1 unless a frame was
//! lit too short or by a failing lamp. With H the projection onto the span of 1, cos and sin of the
//! steps and `S = sum of I I'` over pixels, the residual of the samples divided by their gains is
//! `d' Q d`, `d_k = 1 / g_k`, `Q = (1 - H) * S` element by element. Its least value for gains of mean 1 is in
//! closed form, `d ~ Q^-1 1`. A response curve or noise leaves a residual that no gains take away, so
//! that gains are believed only where they explain most of it.

use super::grid::Grid;
use super::moments::{Moments, rest};
use crate::decode::{AxisPlan, FringeSet};
use nalgebra::DVector;

/// Pixels that are looked at, at most.
const PIXELS: usize = 5000;
/// A step may have so much more or less light than another, relative to the middle one.
const TOLERANCE: f64 = 0.04;
/// Of the residual without gains, less than this part has to be left with them.
const DISTINCT: f64 = 0.5;

/// Whether one step had distinctly more or less light than the others of its set.
pub(super) fn check(axis: &AxisPlan, grid: &Grid) -> Result<(), String> {
    let pixels = grid.sample(PIXELS);
    for set in axis.sets.iter().filter(|set| set.frames.len() > 3) {
        let Some(gains) = gains(set, &pixels) else {
            continue;
        };
        let range = |of: fn(f64, f64) -> f64| gains.iter().copied().reduce(of);
        let spread = range(f64::max).zip(range(f64::min)).map(|(a, b)| a - b);
        let off = |(_, gain): &(usize, f64)| (gain - 1.0).abs();
        let steps = set.frames.iter().copied().zip(gains.iter().copied());
        if let Some((frame, gain)) = steps.max_by(|a, b| off(a).total_cmp(&off(b)))
            && spread > Some(TOLERANCE)
        {
            return Err(format!(
                "frame {frame} has {gain:.2} of the light of the other steps of its fringes"
            ));
        }
    }
    Ok(())
}

/// Gains of the steps, their median 1; none where they explain little.
fn gains(set: &FringeSet, pixels: &[&[f32]]) -> Option<Vec<f64>> {
    let n = set.frames.len();
    let moments = Moments::of(set.frames.clone(), pixels).ordered(&set.frames);
    let residual = rest(set).component_mul(&moments);
    let ones = DVector::from_element(n, 1.0);
    let solved = residual.clone().lu().solve(&ones)?;
    let inverse = &solved * (n as f64 / solved.sum());
    let left = |d: &DVector<f64>| (d.transpose() * &residual * d)[(0, 0)];
    // A comparison with what is no number is false.
    let better = left(&inverse) < DISTINCT * left(&ones);
    let sound = inverse.iter().all(|d| d.is_finite() && *d > 0.1);
    if !better || !sound {
        return None;
    }
    // The bad one moves the mean, hardly the median.
    let mut sorted: Vec<f64> = inverse.iter().copied().collect();
    sorted.sort_by(f64::total_cmp);
    let median = (sorted[(n - 1) / 2] + sorted[n / 2]) / 2.0;
    Some(inverse.iter().map(|d| median / d).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Samples of fringes by a set's phases: gains, a response curve, noise by a rule.
    fn pixels(set: &FringeSet, gains: &[f64], gamma: f64) -> Vec<Vec<f32>> {
        (0..2000)
            .map(|p| {
                let phase = TAU * f64::from(p) * 0.618_034;
                let albedo = 0.3 + 0.6 * (f64::from(p) * 0.414_21).fract();
                let noise =
                    |k: usize| ((p as f64 * 12.9898 + k as f64 * 78.233).sin() * 43758.5).fract();
                (set.phases.iter().zip(gains).enumerate())
                    .map(|(k, (delta, gain))| {
                        let level = 0.5 + 0.45 * (phase + delta).cos();
                        (200.0 * albedo * gain * level.powf(gamma) + 2.0 * noise(k)) as f32
                    })
                    .collect()
            })
            .collect()
    }

    fn set(n: usize) -> FringeSet {
        let phases = (0..n).map(|k| TAU * k as f64 / n as f64).collect();
        FringeSet::new("steps", 16.0, (0..n).collect(), phases).unwrap()
    }

    #[test]
    fn the_gain_of_one_step_is_found() {
        for n in [4, 5, 8, 12] {
            let set = set(n);
            for bad in 0..n {
                let mut given = vec![1.0; n];
                given[bad] = 0.9;
                let samples = pixels(&set, &given, 1.0);
                let views: Vec<&[f32]> = samples.iter().map(Vec::as_slice).collect();
                let found = gains(&set, &views).unwrap();
                for (k, gain) in found.iter().enumerate() {
                    let wanted = if k == bad { 0.9 } else { 1.0 };
                    assert!((gain - wanted).abs() < 0.015, "{n} steps, {k}: {gain}");
                }
            }
        }
    }

    #[test]
    fn sound_steps_and_response_curves_have_none() {
        for n in [4, 5, 12] {
            let set = set(n);
            for gamma in [1.0, 2.2] {
                let samples = pixels(&set, &vec![1.0; n], gamma);
                let views: Vec<&[f32]> = samples.iter().map(Vec::as_slice).collect();
                if let Some(found) = gains(&set, &views) {
                    assert!(found.iter().all(|g| (g - 1.0).abs() < TOLERANCE / 2.0));
                }
            }
        }
    }
}
