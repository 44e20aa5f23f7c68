//! The phase error due to held pixels, in closed form.
//!
//! A projector shows samples of a fringe of period P, each held over one pixel. The samples' spectrum
//! repeats at every integer frequency, and holding multiplies it by sinc(nu): besides the fringe, at 1
//! / P cycles per pixel, there are images at nu = 1 / P + k. Phase steps rotate all of them like the
//! fringe, so no number of steps separates them. A footprint with sides a and b multiplies by sinc(a
//! nu) sinc(b nu). This leaves some thousandths of the nearest images if a camera pixel spans several
//! projector pixels, and more if it spans less than one. At a position x the phase error is the
//! argument of sum over k of g_k / g_0 exp(2 pi i k x), with g_k = sinc(nu) sinc(a nu) sinc(b nu).

use super::closed::Footprint;
use crate::score::px_per_mm;
use glam::DVec2;
use phasmid_core::error::Result;
use phasmid_geometry::Rig;
use phasmid_pattern::Axis;
use phasmid_profile::{Profile, Scene};
use phasmid_render::reference::Reference;
use phasmid_render::truth::Truth;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Number of spectral images on either side of the fringe that are summed; farther images decrease with
/// the cube of their index.
const IMAGES: i32 = 12;

/// Returns the phase error in radians of a fringe with a period in pattern-image pixels, for a
/// footprint.
pub fn phase_bias(period_px: f64, footprint: &Footprint) -> f64 {
    let [a, b] = footprint.reach();
    let g = |nu: f64| sinc(nu) * sinc(a * nu) * sinc(b * nu);
    let sum: DVec2 = (-IMAGES..=IMAGES)
        .map(|k| {
            let turn = DVec2::from_angle(TAU * f64::from(k) * footprint.x());
            turn * g(1.0 / period_px + f64::from(k))
        })
        .sum();
    // A footprint wider than a period sees the fringe inverted.
    let sign = g(1.0 / period_px).signum();
    (sign * sum.y).atan2(sign * sum.x)
}

/// Returns the depth error in millimetres due to held pixels, for each pixel that sees one smooth
/// surface; NaN elsewhere.
///
/// # Errors
/// Returns the errors of [`Reference::new`].
pub fn depth_bias(
    profile: &Profile,
    scene: &Scene,
    rig: &Rig,
    truth: &Truth,
    period_px: f64,
) -> Result<Vec<f64>> {
    let reference = Reference::new(profile, scene)?;
    let width = truth.width as usize;
    let one = |i: usize| {
        let depth = f64::from(truth.depth_mm[i]);
        if truth.flags[i] & Truth::CREASE != 0 || !depth.is_finite() {
            return f64::NAN;
        }
        let px = DVec2::new((i % width) as f64, (i / width) as f64);
        let footprint = Footprint::new(&reference, px);
        let radians = footprint.map_or(f64::NAN, |seen| phase_bias(period_px, &seen));
        radians * period_px / TAU / px_per_mm(rig, px, depth, Axis::X)
    };
    Ok((0..truth.depth_mm.len()).into_par_iter().map(one).collect())
}

/// sin(pi x) / (pi x).
fn sinc(x: f64) -> f64 {
    let t = PI * x;
    if t.abs() < 1e-8 { 1.0 } else { t.sin() / t }
}

#[cfg(test)]
mod tests {
    use super::super::rig::{self, PERIOD_PX};
    use super::*;
    use crate::scanned::Stage;
    use crate::score::depth_errors;
    use phasmid_decode::{Held, Options};
    use phasmid_measure::GROSS_MM;
    use phasmid_render as render;

    fn rms(values: &[f64]) -> f64 {
        (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
    }

    /// Decodes noiseless frames: their errors follow the closed form, for any number of steps.
    #[test]
    fn what_is_off_without_noise_is_the_closed_form() {
        let scene = Scene::load("trapezoid").unwrap();
        for steps in [6, 12, 24] {
            let profile = rig::fine(rig::with_steps(rig::bench(160, 112).unwrap(), steps));
            let mut stage = Stage::new(&profile, &scene, 1, render::Options::default()).unwrap();
            let scanned = stage.scan(0).unwrap();
            let truth = stage.truth();
            let errors = |held| {
                let options = Options {
                    held,
                    ..Options::default()
                };
                depth_errors(&scanned.decode(options).unwrap().1, &truth)
            };
            let [errors, corrected] = [Held::State, Held::Correct].map(errors);
            let bias =
                depth_bias(&profile, &scene, &profile.nominal_rig(), &truth, PERIOD_PX).unwrap();
            let both: Vec<[f64; 2]> = errors
                .iter()
                .zip(&bias)
                .map(|(e, b)| [f64::from(*e), *b])
                .filter(|[e, b]| e.abs() <= GROSS_MM && b.is_finite())
                .collect();
            let off = rms(&both.iter().map(|[e, _]| *e).collect::<Vec<_>>());
            let left = rms(&both.iter().map(|[e, b]| e - b).collect::<Vec<_>>());
            let held = rms(&both.iter().map(|[_, b]| *b).collect::<Vec<_>>());
            let smooth = corrected.iter().zip(&bias).filter(|(_, b)| b.is_finite());
            let inliers = smooth
                .map(|(e, _)| f64::from(*e))
                .filter(|e| e.abs() <= GROSS_MM);
            let corrected = rms(&inliers.collect::<Vec<_>>());
            println!(
                "{steps}: off {off} held {held} left {left} corrected {corrected} of {}",
                both.len()
            );
            assert!(off > 0.005 && left < 0.25 * off, "{steps} {off} {left}");
            // The remaining error is in cells that a crease crosses.
            assert!(corrected < 0.75 * off, "{steps} {off} {corrected}");
        }
    }

    /// Compares the sum over images with the held samples themselves, averaged over a footprint.
    #[test]
    fn images_are_those_of_held_samples() {
        for (x, reach) in [(700.2, [0.9, 0.1]), (33.75, [2.3, 0.6]), (5.5, [0.4, 0.0])] {
            let footprint = Footprint::at(x, reach);
            let (mut sum, n) = (DVec2::ZERO, 600);
            let share = |i: usize| (i as f64 + 0.5) / n as f64 - 0.5;
            for i in 0..n {
                for j in 0..n {
                    let place = x + reach[0] * share(i) + reach[1] * share(j);
                    sum += DVec2::from_angle(TAU * (place + 0.5).floor() / PERIOD_PX);
                }
            }
            let wanted = DVec2::from_angle(TAU * x / PERIOD_PX).angle_to(sum);
            let found = phase_bias(PERIOD_PX, &footprint);
            // The tolerance covers 12 images falling as 1 / k^2 to 1 / k^3, and the steps between
            // samples.
            assert!((found - wanted).abs() < 2e-3, "{x} {found} {wanted}");
        }
    }
}
