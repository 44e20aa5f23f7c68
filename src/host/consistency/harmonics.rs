//! Whether fringes are sinusoidal.
//!
//! N equal steps do not tell harmonics of order N - 1 and N + 1 from the fringe itself, so that no
//! residual shows them: with amplitudes B_m they move the phase by about
//! `(B_{N-1} - B_{N+1}) / B sin(N phi)`. But they change the modulation too, by
//! `(B_{N-1} + B_{N+1}) cos(N phi)` (both follow from the N-step sums of `sum_m B_m cos(m phi)`). White
//! less black is what the modulation is measured by, since surfaces differ. An exposure that does not
//! cover all bit planes of a DMD leaves fringes with steps in them, which are such harmonics.
//!
//! What is not found: harmonics whose two orders cancel in the modulation, and those of sequences
//! without white and black (both are `evenness`' to find), and those of steps that are not equal.

use super::evenness::{LARGEST_RAD, REFUSED_STEPS};
use super::scatter::Scatter;
use nalgebra::{Matrix3, Vector3};
use phasmid_decode::FringeSet;
use std::f64::consts::TAU;

/// Fewest pixels that tell.
const FEWEST: usize = 1000;
/// Contrast of white and black in DN from which on a pixel is looked at,
const LEAST_DN: f64 = 8.0;
/// and in deviations of the noise.
const LEAST_SIGMAS: f64 = 10.0;
/// Part of the usual pixel's modulation from which on one is looked at, for blur takes the rest, and up
/// to which it is believed.
const USUAL: std::ops::Range<f64> = 0.5..2.0;

/// Whether harmonics of the fringes move the phase by more than is believed.
pub(super) fn check(
    set: &FringeSet,
    references: Option<(usize, usize)>,
    noise_dn: f32,
    scatter: &Scatter,
) -> Result<(), String> {
    if set.frames.len() < REFUSED_STEPS {
        return Ok(());
    }
    let found = references.and_then(|references| ripple(set, references, noise_dn, scatter));
    let Some(found) = found else {
        return Ok(());
    };
    if found <= LARGEST_RAD {
        return Ok(());
    }
    let frames = &set.frames;
    Err(format!(
        "the fringes of frames {} to {} are not sinusoidal: the modulation changes with the phase by \
         {:.0} %, and the phase is off by up to about {found:.2} rad; does the camera's exposure \
         cover all of the pattern's, and is the projector's response straight?",
        frames[0],
        frames[frames.len() - 1],
        100.0 * found
    ))
}

/// How far the modulation follows N times the phase, in parts of it.
fn ripple(
    set: &FringeSet,
    (white, black): (usize, usize),
    noise_dn: f32,
    scatter: &Scatter,
) -> Option<f64> {
    if !set.steps_are_equal() {
        return None;
    }
    let n = set.phases.len() as f64;
    let least = LEAST_DN.max(LEAST_SIGMAS * f64::from(noise_dn));
    let first = set.phases[0];
    // Modulation in parts of half the contrast, and phase.
    let told = |pixel: &[f32]| {
        let contrast = f64::from(pixel[white] - pixel[black]);
        (contrast >= least).then(|| {
            let samples: Vec<f64> = set.frames.iter().map(|f| f64::from(pixel[*f])).collect();
            let [_, c, s] = set.solve(&samples);
            (2.0 * c.hypot(s) / contrast, s.atan2(c) + first)
        })
    };
    let mut told: Vec<(f64, f64)> = scatter.pixels().filter_map(told).collect();
    if told.len() < FEWEST {
        return None;
    }
    let middle = told.len() / 2;
    let usual = told
        .select_nth_unstable_by(middle, |a, b| a.0.total_cmp(&b.0))
        .1
        .0;
    told.retain(|(modulation, _)| USUAL.contains(&(modulation / usual)));
    let mut normal = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for (modulation, phase) in told {
        let turns = n * phase.rem_euclid(TAU);
        let row = Vector3::new(1.0, turns.cos(), turns.sin());
        normal += row * row.transpose();
        right += row * modulation;
    }
    let fitted = normal.try_inverse()? * right;
    Some(fitted[1].hypot(fitted[2]) / fitted[0])
}

#[cfg(test)]
mod tests {
    use super::super::scatter::MANY;
    use super::*;
    use phasmid_pattern::Image;

    /// Frames of `n` steps, white and black, whose fringes have a harmonic of an order and amplitude.
    fn frames(n: usize, order: f64, amplitude: f64) -> Vec<Image> {
        let (width, height) = (128u32, 64u32);
        let level = |k: usize, i: u32| {
            let phase = TAU * (f64::from(i % width) / 21.3 + k as f64 / n as f64);
            let albedo = 0.6 + 0.4 * f64::from(i / width) / f64::from(height);
            let wave = phase.cos() + amplitude * (order * phase).cos();
            let light = match k {
                k if k == n => 1.0,
                k if k > n => 0.0,
                _ => 0.5 + 0.4 * wave,
            };
            (100.0 + 50_000.0 * albedo * light) as u16
        };
        (0..n + 2)
            .map(|k| {
                Image::new(
                    width as usize,
                    height as usize,
                    (0..width * height)
                        .map(|i| level(k, i))
                        .collect::<Vec<u16>>(),
                )
                .unwrap()
            })
            .collect()
    }

    #[test]
    fn the_ripple_is_the_harmonic_that_is_taken_for_the_fringe() {
        for n in [3, 4, 5] {
            let phases = (0..n).map(|k| TAU * k as f64 / n as f64).collect();
            let set = FringeSet::new("steps", 16.0, (0..n).collect(), phases).unwrap();
            let found = |order: f64, amplitude: f64| {
                let scatter = Scatter::new(&frames(n, order, amplitude), MANY);
                ripple(&set, (n, n + 1), 0.0, &scatter).unwrap()
            };
            assert!(found(n as f64 - 1.0, 0.0) < 1e-3);
            for order in [n as f64 - 1.0, n as f64 + 1.0] {
                let ripple = found(order, 0.1);
                // To second order in the amplitude.
                assert!((ripple - 0.1).abs() < 0.01, "{n} steps, {order}: {ripple}");
            }
            // Others are told from the fringe.
            assert!(found(n as f64 + 2.0, 0.1) < 0.01);
        }
    }
}
