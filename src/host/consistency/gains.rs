//! The light of each step of the fringe sets against that of the others.
//!
//! Steps k of one set see `A + B cos(phi + delta_k)`, times a gain `g_k` that is 1 unless a frame was
//! lit too short or by a failing lamp, and all sets of a pixel see one A, so that even sets of three
//! steps tell. With H the projection onto the span of 1 and of cos and sin of the steps of each set, and
//! `S = sum of I I'` over pixels, the residual of the samples divided by their gains is
//! `d' Q d`, `d_k = 1 / g_k`, `Q = (1 - H) * S` element by element. Its least value for gains of mean 1 is in
//! closed form, `d ~ Q^-1 1`. A response curve or noise leaves a residual that no gains take away, so
//! that gains are believed only where they explain most of it.

use super::grid::Grid;
use super::moments::{Moments, rest};
use nalgebra::DVector;
use phasmid_decode::{FringeSet, Plan};

/// Pixels that are looked at, at most.
const PIXELS: usize = 5000;
/// A step may have so much more or less light than another, relative to the middle one.
const TOLERANCE: f64 = 0.04;
/// Of the residual without gains, less than this part has to be left with them.
const DISTINCT: f64 = 0.5;
/// Part of the sum of the inverse gains that a step has to have to be called dark.
const DARK: f64 = 0.8;

/// Whether one step had distinctly more or less light than the others.
pub(super) fn check(plan: &Plan, grid: &Grid) -> Result<(), String> {
    let sets: Vec<&FringeSet> = plan.axes.iter().flat_map(|axis| &axis.sets).collect();
    let pixels = grid.sample(PIXELS);
    let Some(gains) = gains(&sets, &pixels) else {
        return Ok(());
    };
    let range = |of: fn(f64, f64) -> f64| gains.iter().copied().reduce(of);
    let spread = range(f64::max).zip(range(f64::min)).map(|(a, b)| a - b);
    let off = |(_, gain): &(usize, f64)| (gain - 1.0).abs();
    let steps = frames(&sets).into_iter().zip(gains.iter().copied());
    if let Some((frame, gain)) = steps.max_by(|a, b| off(a).total_cmp(&off(b)))
        && spread > Some(TOLERANCE)
    {
        return Err(format!(
            "frame {frame} has {gain:.2} of the light of the other steps of fringes"
        ));
    }
    Ok(())
}

fn frames(sets: &[&FringeSet]) -> Vec<usize> {
    let frames = sets.iter().flat_map(|set| set.frames.iter().copied());
    frames.collect()
}

/// Gains of the steps of sets, their median 1; none where they explain little.
fn gains(sets: &[&FringeSet], pixels: &[&[f32]]) -> Option<Vec<f64>> {
    let frames = frames(sets);
    let n = frames.len();
    // As many unknowns as steps leave nothing.
    if n < 2 + 2 * sets.len() {
        return None;
    }
    let moments = Moments::of(frames.clone(), pixels).ordered(&frames);
    let residual = rest(sets).component_mul(&moments);
    let ones = DVector::from_element(n, 1.0);
    let solved = residual.clone().lu().solve(&ones)?;
    let inverse = &solved * (n as f64 / solved.sum());
    let left = |d: &DVector<f64>| (d.transpose() * &residual * d)[(0, 0)];
    // A comparison with what is no number is false.
    let better = left(&inverse) < DISTINCT * left(&ones);
    if !better || !inverse.iter().all(|d| d.is_finite()) {
        return None;
    }
    // Of a frame that was dark alone nothing is left, so that it has all of the inverses, and the others
    // have what noise gives them.
    if let Some(dark) = inverse.iter().position(|d| *d > DARK * n as f64) {
        return Some((0..n).map(|k| f64::from(k != dark)).collect());
    }
    // The bad one moves the mean, hardly the median.
    let mut sorted: Vec<f64> = inverse.iter().copied().collect();
    sorted.sort_by(f64::total_cmp);
    let median = (sorted[(n - 1) / 2] + sorted[n / 2]) / 2.0;
    // A frame that was dark has the inverse of next to nothing, of either sign.
    let gain = |d: &f64| if *d > 0.0 { median / d } else { 0.0 };
    Some(inverse.iter().map(gain).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Samples of sets' fringes at places of a surface: gains, a response curve, noise by a rule.
    fn pixels(sets: &[FringeSet], gains: &[f64], gamma: f64) -> Vec<Vec<f32>> {
        let pixel = |p: u32| {
            let place = 16.0 * f64::from(p) * 0.618_034;
            let albedo = 0.3 + 0.6 * (f64::from(p) * 0.414_21).fract();
            let noise =
                |k: usize| ((f64::from(p) * 12.9898 + k as f64 * 78.233).sin() * 43758.5).fract();
            let level = |set: &FringeSet, delta: f64| {
                0.5 + 0.45 * (TAU * place / set.period_px + delta).cos()
            };
            let steps = sets
                .iter()
                .flat_map(|set| set.phases.iter().map(move |d| (set, *d)));
            let value = |(k, (set, delta)): (usize, (&FringeSet, f64))| {
                (200.0 * albedo * gains[k] * level(set, delta).powf(gamma) + 2.0 * noise(k)) as f32
            };
            steps.enumerate().map(value).collect()
        };
        (0..2000).map(pixel).collect()
    }

    /// Sets of equal steps, each of a tenth of the period of the one before.
    fn sets(steps: &[usize]) -> Vec<FringeSet> {
        let mut frames = 0..;
        let set = |(i, n): (usize, &usize)| {
            let phases = (0..*n).map(|k| TAU * k as f64 / *n as f64).collect();
            let frames = frames.by_ref().take(*n).collect();
            FringeSet::new("steps", 16.0 * 10f64.powi(i as i32), frames, phases).unwrap()
        };
        steps.iter().enumerate().map(set).collect()
    }

    fn found(sets: &[FringeSet], given: &[f64], gamma: f64) -> Option<Vec<f64>> {
        let samples = pixels(sets, given, gamma);
        let views: Vec<&[f32]> = samples.iter().map(Vec::as_slice).collect();
        gains(&sets.iter().collect::<Vec<_>>(), &views)
    }

    #[test]
    fn the_gain_of_one_step_is_found() {
        for steps in [&[4][..], &[5], &[8], &[12], &[3, 3], &[3, 3, 3], &[3, 4]] {
            let sets = sets(steps);
            let n = steps.iter().sum();
            for bad in 0..n {
                let mut given = vec![1.0; n];
                given[bad] = 0.9;
                let found = found(&sets, &given, 1.0).unwrap();
                for (k, gain) in found.iter().enumerate() {
                    let wanted = if k == bad { 0.9 } else { 1.0 };
                    assert!((gain - wanted).abs() < 0.015, "{steps:?}, {k}: {gain}");
                }
            }
        }
    }

    #[test]
    fn a_dark_step_is_the_one_that_is_named() {
        for steps in [&[4][..], &[12], &[3, 3, 3]] {
            let sets = sets(steps);
            let n = steps.iter().sum();
            for bad in 0..n {
                let mut given = vec![1.0; n];
                given[bad] = 0.0;
                let found = found(&sets, &given, 1.0).unwrap();
                let least = (0..n).min_by(|a, b| found[*a].total_cmp(&found[*b]));
                assert_eq!(least, Some(bad), "{steps:?}: {found:?}");
                let near = |g: &f64| (g - 1.0).abs() < 0.5;
                assert_eq!(found.iter().filter(|g| near(g)).count(), n - 1, "{found:?}");
            }
        }
    }

    #[test]
    fn sound_steps_and_response_curves_have_none() {
        for steps in [&[4][..], &[5], &[12], &[3, 3], &[3, 3, 3], &[3, 4]] {
            let sets = sets(steps);
            for gamma in [0.5, 1.0, 2.2] {
                let none = vec![1.0; steps.iter().sum()];
                if let Some(found) = found(&sets, &none, gamma) {
                    let near = |g: &f64| (g - 1.0).abs() < TOLERANCE / 2.0;
                    assert!(found.iter().all(near), "{steps:?}, {gamma}: {found:?}");
                }
            }
        }
    }

    #[test]
    fn three_steps_alone_tell_nothing() {
        assert_eq!(found(&sets(&[3]), &[1.0, 0.8, 1.0], 1.0), None);
    }
}
