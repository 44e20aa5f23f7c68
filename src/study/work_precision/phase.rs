//! Phases of fringes pixel by pixel, and their differences expressed as depth.

use super::rig::PERIOD_PX;
use crate::score::px_per_mm;
use glam::DVec2;
use phasmid_geometry::Rig;
use phasmid_measure::GROSS_MM;
use phasmid_pattern::Axis;
use phasmid_render::truth::Truth;
use std::f64::consts::TAU;

/// Returns the modulation and phase of each pixel as a complex number, computed from N equally spaced
/// steps: the first Fourier coefficient, which is the least-squares fit of A + B cos(phase + step).
pub fn phasors(frames: &[Vec<f64>]) -> Vec<DVec2> {
    let steps = frames.len() as f64;
    let pixels = frames.first().map_or(0, Vec::len);
    let mut sums = vec![DVec2::ZERO; pixels];
    for (k, frame) in frames.iter().enumerate() {
        let turn = DVec2::from_angle(-TAU * k as f64 / steps) * (2.0 / steps);
        for (sum, level) in sums.iter_mut().zip(frame) {
            *sum += turn * *level;
        }
    }
    sums
}

/// Returns millimetres of depth per radian of phase, for each pixel of the truth.
pub fn mm_per_radian(rig: &Rig, truth: &Truth) -> Vec<f64> {
    let width = truth.width as usize;
    let one = |i: usize| {
        let px = DVec2::new((i % width) as f64, (i / width) as f64);
        let depth = f64::from(truth.depth_mm[i]);
        PERIOD_PX / TAU / px_per_mm(rig, px, depth, Axis::X).abs()
    };
    (0..truth.depth_mm.len()).map(one).collect()
}

/// Phase errors in millimetres of depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// Root mean square of the errors of at most 1 mm; NaN without such errors.
    pub inlier_rmse_mm: f64,
    /// Fraction of errors above 1 mm, or of phases with a modulation where the exact ones have none.
    pub gross: f64,
    /// Fraction of the exact phases with a modulation that have a modulation here too.
    pub coverage: f64,
}

/// Compares phasors with exact ones pixel by pixel; `least` is the minimum modulation.
pub fn difference(
    found: &[DVec2],
    exact: &[DVec2],
    mm_per_radian: &[f64],
    least: f64,
) -> Difference {
    let (mut squares, mut inliers, mut gross) = (0.0, 0usize, 0usize);
    let (mut wanted, mut both) = (0usize, 0usize);
    for ((found, exact), mm) in found.iter().zip(exact).zip(mm_per_radian) {
        let there = found.length() >= least;
        if exact.length() < least {
            gross += usize::from(there);
            continue;
        }
        wanted += 1;
        if !there {
            continue;
        }
        both += 1;
        let off = exact.angle_to(*found) * mm;
        if off.abs() > GROSS_MM {
            gross += 1;
        } else if off.is_finite() {
            inliers += 1;
            squares += off * off;
        }
    }
    let points = inliers + gross;
    Difference {
        inlier_rmse_mm: (squares / inliers as f64).sqrt(),
        gross: gross as f64 / points as f64,
        coverage: both as f64 / wanted as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_come_back_and_their_errors_are_depths() {
        let level = |k: usize, steps: usize, phase: f64| {
            100.0 + 40.0 * (phase + TAU * k as f64 / steps as f64).cos()
        };
        let phases = [0.3, 3.1, -3.1, 1.0];
        for steps in [3, 4, 12] {
            let frame = |k| phases.iter().map(|p| level(k, steps, *p)).collect();
            let found = phasors(&(0..steps).map(frame).collect::<Vec<Vec<f64>>>());
            for (found, phase) in found.iter().zip(phases) {
                assert!((*found - 40.0 * DVec2::from_angle(phase)).length() < 1e-12);
            }
        }
        // Cases: across the wrap, gross, and without modulation on either side.
        let turned = [0.31, -3.13, -3.1, 1.0].map(|p| 40.0 * DVec2::from_angle(p));
        let mut exact = phases.map(|p| 40.0 * DVec2::from_angle(p));
        exact[2] *= -1.0;
        let all = difference(&turned, &exact, &[2.0; 4], 1.0);
        let wrapped: f64 = 2.0 * (TAU - 6.23);
        let squares = 0.02f64.powi(2) + wrapped.powi(2);
        assert!((all.inlier_rmse_mm - (squares / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!((all.gross, all.coverage), (0.25, 1.0));
        exact[3] = DVec2::ZERO;
        let mut turned = turned;
        turned[0] = DVec2::ZERO;
        let all = difference(&turned, &exact, &[2.0; 4], 1.0);
        assert_eq!(
            all.gross,
            2.0 / 3.0,
            "one is off, one is where there is none"
        );
        assert_eq!(all.coverage, 2.0 / 3.0);
    }
}
