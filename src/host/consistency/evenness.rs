//! Whether phase runs evenly along a line.
//!
//! N equal steps take harmonics of order N - 1 and N + 1 for the fringe itself, and the phase is off by
//! `e = a cos(N phi) + b sin(N phi)` ([`harmonics`](super::harmonics)). Along a surface the phase grows by
//! about the same `w` from each pixel to the next, so that its second difference is what the error leaves
//! of itself: `e(phi + w) - 2 e(phi) + e(phi - w) = -2 (1 - cos(N w)) e(phi)`. That is linear in `a` and
//! `b`, which least squares find from all pixels. Curved surfaces, texture and noise have second
//! differences too, but not such as follow the phase.
//!
//! Coarse fringes grow too little from pixel to pixel to show it; they only tell which fringe of the fine
//! ones it is, and are left out.
//!
//! Three steps take the second harmonic for the fringe, which any response curve but a straight one
//! has: that is a property of the device, and is told without refusing anything. With four steps and
//! more an error of that size is none that a response curve makes.

use super::FrameDoubt;
use super::grid::{Grid, Line};
use nalgebra::{Matrix2, Vector2};
use phasmid_decode::FringeSet;
use std::f64::consts::{PI, TAU};

/// The largest error of phase in radians of four and more steps that is believed: a projector of gamma
/// 0.6 and four steps has 0.06, one of 2.2 has 0.01.
pub(super) const LARGEST_RAD: f64 = 0.08;
/// Steps from which on it is refused.
pub(super) const REFUSED_STEPS: usize = 4;
/// The largest that is not worth telling: 0.05 projector pixels of a fringe of 16.
const WORTH_RAD: f64 = 0.02;
/// Deviations that an error is more than what is held against it.
const SIGMAS: f64 = 4.0;
/// Every so many'th line is looked at.
const LINES: usize = 4;
/// Fewest pixels that tell.
const FEWEST: usize = 500;
/// Least modulation in DN,
const LEAST_DN: f64 = 3.0;
/// and in deviations of the noise.
const LEAST_SIGMAS: f64 = 4.0;
/// Most that the phase grows from a pixel to the next, and most by which it grows more than before: edges.
const MOST_RAD: (f64, f64) = (1.5, 1.0);
/// Part of an error that is left in second differences, squared, of all pixels.
const LEAST_SHOWN: f64 = 0.1;

/// Whether the phase of a set is off by more than is believed, as a function of itself.
pub(super) fn check(set: &FringeSet, grid: &Grid) -> Result<(), String> {
    match set.frames.len() >= REFUSED_STEPS {
        true => beyond(LARGEST_RAD, set, grid).map_or(Ok(()), |doubt| Err(doubt.to_string())),
        false => Ok(()),
    }
}

/// What is to be told of a set's phase.
pub(super) fn doubt(set: &FringeSet, grid: &Grid) -> Option<FrameDoubt> {
    beyond(WORTH_RAD, set, grid)
}

/// Returns the doubt if the phase is certainly off by more than `least_rad`.
fn beyond(least_rad: f64, set: &FringeSet, grid: &Grid) -> Option<FrameDoubt> {
    let (found, deviation) = phase_error(set, grid)?;
    (found - SIGMAS * deviation > least_rad).then(|| FrameDoubt::NotSinusoidal {
        frames: set.frames[0]..=set.frames[set.frames.len() - 1],
        phase_error_rad: found,
    })
}

/// The amplitude of the error of phase and its standard deviation, in radians; none where too few pixels
/// would show it.
fn phase_error(set: &FringeSet, grid: &Grid) -> Option<(f64, f64)> {
    if !set.steps_are_equal() {
        return None;
    }
    let n = set.phases.len() as f64;
    let mut normal = Matrix2::zeros();
    let mut right = Vector2::zeros();
    let (mut shown, mut square) = (0.0, 0.0);
    let mut pixels = 0;
    for line in grid.lines.iter().step_by(LINES) {
        let phases = phases(set, line, f64::from(grid.noise_dn));
        for three in phases.windows(3) {
            let &[Some(before), Some(here), Some(after)] = three else {
                continue;
            };
            let (rise, next) = (wrapped(here - before), wrapped(after - here));
            let grows = 0.5 * (rise + next);
            if grows.abs() > MOST_RAD.0 || (next - rise).abs() > MOST_RAD.1 {
                continue;
            }
            let left = -2.0 * (1.0 - (n * grows).cos());
            let row = left * Vector2::new((n * here).cos(), (n * here).sin());
            normal += row * row.transpose();
            right += row * (next - rise);
            shown += left * left;
            square += (next - rise).powi(2);
            pixels += 1;
        }
    }
    if pixels < FEWEST || shown < LEAST_SHOWN * pixels as f64 {
        return None;
    }
    let inverse = normal.try_inverse()?;
    let error = inverse * right;
    let variance = (square - error.dot(&right)).max(0.0) / pixels as f64;
    let most = inverse.symmetric_eigenvalues().max();
    Some((error.norm(), (variance * most).sqrt()))
}

/// The phase of each pixel of a line that has fringes.
fn phases(set: &FringeSet, line: &Line, noise_dn: f64) -> Vec<Option<f64>> {
    let least = LEAST_DN.max(LEAST_SIGMAS * noise_dn);
    let mut samples = Vec::with_capacity(set.frames.len());
    let phase = |i: usize| {
        if !line.varies[i] {
            return None;
        }
        let pixel = line.pixel(i);
        samples.clear();
        samples.extend(set.frames.iter().map(|f| f64::from(pixel[*f])));
        let [_, c, s] = set.solve(&samples);
        (c.hypot(s) >= least).then(|| s.atan2(c) + set.phases[0])
    };
    (0..line.len()).map(phase).collect()
}

/// An angle between -pi and pi.
fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_pattern::Axis;
    use phasmid_pattern::Image;

    /// Frames of `n` steps of fringes of a period in pixels, with harmonics by order and amplitude, and as
    /// many uniform ones.
    fn grid(n: usize, period_px: f64, harmonics: &[(f64, f64)]) -> Grid {
        let (width, height) = (160u32, 64u32);
        let level = |k: usize, i: u32| {
            let (x, y) = (f64::from(i % width), f64::from(i / width));
            let bent = 0.4 * (x / 40.0).sin() + 0.011 * y;
            let phase = TAU * (x / period_px + k as f64 / n as f64) + bent;
            let wave = |(order, amplitude): &(f64, f64)| amplitude * (order * phase).cos();
            let wave = phase.cos() + harmonics.iter().map(wave).sum::<f64>();
            let shown = if k < n { wave } else { 0.0 };
            (20_000.0 + 10_000.0 * (0.6 + 0.4 * y / 64.0) * shown) as u16
        };
        let frame = |k: usize| {
            Image::new(
                width as usize,
                height as usize,
                (0..width * height)
                    .map(|i| level(k, i))
                    .collect::<Vec<u16>>(),
            )
            .unwrap()
        };
        Grid::new(&(0..2 * n).map(frame).collect::<Vec<_>>(), Axis::X)
    }

    #[test]
    fn the_error_is_that_of_the_neighbouring_harmonics() {
        for n in [3, 4, 5] {
            let phases = (0..n).map(|k| TAU * k as f64 / n as f64).collect();
            let set = FringeSet::new("steps", 16.0, (0..n).collect(), phases).unwrap();
            let (below, above) = (n as f64 - 1.0, n as f64 + 1.0);
            for period_px in [7.3, 8.0, 9.1] {
                let found = |harmonics: &[(f64, f64)]| {
                    phase_error(&set, &grid(n, period_px, harmonics)).unwrap().0
                };
                let close = |found: f64, want: f64| {
                    // To second order in the amplitudes.
                    let what = format!("{n} steps of {period_px} px: {found}, not {want}");
                    assert!((found - want).abs() < 0.1 * want + 0.005, "{what}");
                };
                close(found(&[]), 0.0);
                close(found(&[(below, 0.1)]), 0.1);
                close(found(&[(above, 0.1)]), 0.1);
                // These cancel in the modulation.
                close(found(&[(below, 0.06), (above, -0.06)]), 0.12);
                // And these in the phase.
                close(found(&[(below, 0.06), (above, 0.06)]), 0.0);
                // Others are told from the fringe.
                close(found(&[(above + 1.0, 0.1)]), 0.0);
            }
        }
    }

    #[test]
    fn coarse_fringes_do_not_show_it() {
        let phases = (0..3).map(|k| TAU * f64::from(k) / 3.0).collect();
        let set = FringeSet::new("steps", 16.0, vec![0, 1, 2], phases).unwrap();
        assert_eq!(phase_error(&set, &grid(3, 150.0, &[(2.0, 0.2)])), None);
    }
}
