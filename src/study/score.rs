//! A decoded scan compared with the truth, pixel by pixel: inlier error, gross errors and coverage
//! separately, and the ratio of the error to the noise bound.

use glam::{DVec2, DVec3};
use phasmid_core::error::{Error, Result};
use phasmid_decode::Decoded;
use phasmid_geometry::{Cloud, NoiseModel, Rig, View};
use phasmid_measure::{GROSS_MM, Stated, Surface, compare};
use phasmid_pattern::{Axis, Manifest, finest_fringe};
use phasmid_render::truth::Truth;
use serde::Serialize;
use std::f64::consts::TAU;

/// Errors of pixels whose footprint lies on one smooth surface; `crease` has the errors of all other
/// pixels. An error is NaN (null in JSON) without such pixels.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Score {
    /// Pixels with a measured point.
    pub points: usize,
    /// Fraction of valid pixels among those that are lit and seen at less than 80 degrees of incidence.
    pub coverage: f64,
    /// Fraction of points that are more than 1 mm off in depth, or at pixels that see no surface.
    pub gross_error_rate: f64,
    /// Root mean square depth error of the points without a gross error, in millimetres.
    pub inlier_rmse_mm: f64,
    /// Mean absolute depth error of all points that have a true depth, in millimetres.
    pub mae_mm: f64,
    /// Largest distance between the measured and the true surface, in both directions, in millimetres.
    pub hausdorff_mm: f64,
    /// Mean distance to agreement: the mean distance from each surface to the other one, in millimetres.
    pub mdta_mm: f64,
    /// Root mean square over pixels of the bound sqrt(2/N) sigma/B propagated to depth, in millimetres.
    pub bound_mm: f64,
    /// Root mean square of the ratio of the inliers' errors to their pixels' bounds.
    pub ratio_to_bound: f64,
    /// Errors relative to the standard deviations stated by the decoder; a point at a pixel without a
    /// surface counts as off by more than five standard deviations.
    #[serde(flatten)]
    pub stated: Stated,
    /// Errors of pixels that contain more than one facet or object.
    pub crease: CreaseScore,
}

/// Errors of pixels that contain more than one facet or object, or a shadow edge.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CreaseScore {
    /// Number of points.
    pub points: usize,
    /// Fraction of valid pixels among those that are lit and seen at less than 80 degrees of incidence.
    pub coverage: f64,
    /// Fraction of points more than 1 mm off.
    pub gross_error_rate: f64,
    /// Root mean square depth error of the points without a gross error, in millimetres.
    pub inlier_rmse_mm: f64,
    /// Mean absolute depth error, in millimetres.
    pub mae_mm: f64,
}

/// Returns the depth errors by pixel in millimetres, NaN without a measured or a true point.
pub fn depth_errors(decoded: &Decoded, truth: &Truth) -> Vec<f32> {
    decoded
        .depth
        .iter()
        .zip(&truth.depth_mm)
        .map(|(measured, exact)| measured - exact)
        .collect()
}

/// Scores a scan made with `manifest`. `rig` is the true rig; without its noise model the bound
/// contains rounding alone.
///
/// # Errors
/// Returns an error if the scan has no depth or its size differs from that of the truth.
pub fn score(decoded: &Decoded, truth: &Truth, manifest: &Manifest, rig: &Rig) -> Result<Score> {
    let n = truth.depth_mm.len();
    if decoded.depth.len() != n || decoded.width != truth.width as usize {
        return Err(Error::device(format!(
            "the scan has {} depths of {} columns, the truth {n} of {}",
            decoded.depth.len(),
            decoded.width,
            truth.width
        )));
    }
    let errors = depth_errors(decoded, truth);
    let is_crease = |i: usize| truth.flags[i] & Truth::CREASE != 0;
    let smooth = Tally::over((0..n).filter(|&i| !is_crease(i)), decoded, truth, &errors);
    let crease = Tally::over((0..n).filter(|&i| is_crease(i)), decoded, truth, &errors);
    let noise = Noise::new(manifest, rig, truth);
    let (bound_mm, ratio_to_bound) = noise.compare(&errors);
    let of_smooth = |i: usize| (f64::from(errors[i]), f64::from(decoded.depth_sigma[i]));
    let stated = Stated::of(
        (0..n)
            .filter(|&i| !is_crease(i) && decoded.depth[i].is_finite())
            .map(of_smooth),
    );
    let (hausdorff_mm, mdta_mm) = surfaces(decoded, truth, rig)?;
    Ok(Score {
        points: decoded.depth.iter().filter(|z| z.is_finite()).count(),
        coverage: smooth.coverage(),
        gross_error_rate: smooth.gross_rate(),
        inlier_rmse_mm: smooth.inlier_rmse(),
        mae_mm: smooth.mae(),
        hausdorff_mm,
        mdta_mm,
        bound_mm,
        ratio_to_bound,
        stated,
        crease: CreaseScore {
            points: crease.points,
            coverage: crease.coverage(),
            gross_error_rate: crease.gross_rate(),
            inlier_rmse_mm: crease.inlier_rmse(),
            mae_mm: crease.mae(),
        },
    })
}

/// Computes the least-squares noise bound of the finest fringes for each pixel, propagated to depth, in
/// millimetres; NaN where the truth has no modulation. `rig` is the true rig; without its noise model
/// the bound contains rounding alone.
pub fn depth_bounds(truth: &Truth, manifest: &Manifest, rig: &Rig) -> Vec<f64> {
    let noise = Noise::new(manifest, rig, truth);
    (0..truth.depth_mm.len())
        .map(|i| noise.bound_mm(i))
        .collect()
}

/// Counts and sums over a set of pixels.
#[derive(Default)]
struct Tally {
    points: usize,
    with_truth: usize,
    gross: usize,
    absolute: f64,
    inliers: usize,
    squares: f64,
    /// Number of pixels that a scanner should measure, then the number of these that it measured.
    expected: usize,
    found: usize,
}

impl Tally {
    fn over(
        pixels: impl Iterator<Item = usize>,
        decoded: &Decoded,
        truth: &Truth,
        errors: &[f32],
    ) -> Self {
        let mut t = Self::default();
        let wanted = Truth::SEEN | Truth::LIT | Truth::SQUARE;
        for i in pixels {
            let valid = decoded.depth[i].is_finite();
            if truth.flags[i] & wanted == wanted {
                t.expected += 1;
                t.found += usize::from(valid);
            }
            if !valid {
                continue;
            }
            t.points += 1;
            let error = f64::from(errors[i]).abs();
            if error.is_nan() {
                // The pixel of this point sees no surface.
                t.gross += 1;
                continue;
            }
            t.with_truth += 1;
            t.absolute += error;
            if error > GROSS_MM {
                t.gross += 1;
            } else {
                t.inliers += 1;
                t.squares += error * error;
            }
        }
        t
    }

    fn coverage(&self) -> f64 {
        ratio(self.found as f64, self.expected)
    }
    fn gross_rate(&self) -> f64 {
        ratio(self.gross as f64, self.points)
    }
    fn inlier_rmse(&self) -> f64 {
        ratio(self.squares, self.inliers).sqrt()
    }
    fn mae(&self) -> f64 {
        ratio(self.absolute, self.with_truth)
    }
}

/// Divides a sum by a count; NaN (null in JSON) for a count of 0, because no data is not a small error.
fn ratio(sum: f64, count: usize) -> f64 {
    if count == 0 {
        f64::NAN
    } else {
        sum / count as f64
    }
}

/// The least-squares noise bound of the finest fringes, propagated to depth.
struct Noise<'a> {
    rig: &'a Rig,
    truth: &'a Truth,
    model: NoiseModel,
    axis: Axis,
    /// Factor from sigma / B to the standard deviation of the projector coordinate, in pixels.
    px_per_ratio: f64,
}

impl<'a> Noise<'a> {
    fn new(manifest: &Manifest, rig: &'a Rig, truth: &'a Truth) -> Self {
        let patterns = || manifest.frame.iter().map(|f| &f.pattern);
        let (axis, period_px) = finest_fringe(patterns()).unwrap_or((Axis::X, f64::NAN));
        let steps = patterns()
            .filter(|p| finest_fringe(std::iter::once(*p)) == Some((axis, period_px)))
            .count();
        Self {
            rig,
            truth,
            model: rig.noise.unwrap_or(NoiseModel {
                gain_dn_per_e: 0.0,
                read_noise_dn: 0.0,
                black_level_dn: 0.0,
                saturation_dn: f64::INFINITY,
            }),
            axis,
            px_per_ratio: period_px / TAU * (2.0 / steps as f64).sqrt(),
        }
    }

    /// Returns the bound at a pixel in millimetres; NaN where the truth has no modulation.
    fn bound_mm(&self, i: usize) -> f64 {
        let width = self.truth.width as usize;
        let px = DVec2::new((i % width) as f64, (i / width) as f64);
        let sigma = self.model.variance_dn2(self.truth.mean_dn[i].into()).sqrt();
        let sigma_px = self.px_per_ratio * sigma / f64::from(self.truth.modulation_dn[i]);
        let depth = f64::from(self.truth.depth_mm[i]);
        sigma_px / px_per_mm(self.rig, px, depth, self.axis).abs()
    }

    /// Returns the RMS of the bounds and of the ratio of error to bound, over inliers outside creases.
    fn compare(&self, errors: &[f32]) -> (f64, f64) {
        let (mut count, mut bounds, mut ratios) = (0usize, 0.0, 0.0);
        for (i, &error) in errors.iter().enumerate() {
            let error = f64::from(error);
            // A NaN fails the comparison and is not an inlier.
            if self.truth.flags[i] & Truth::CREASE != 0 || !(error.abs() <= GROSS_MM) {
                continue;
            }
            let bound = self.bound_mm(i);
            if bound.is_finite() && bound > 0.0 {
                count += 1;
                bounds += bound * bound;
                ratios += (error / bound).powi(2);
            }
        }
        (ratio(bounds, count).sqrt(), ratio(ratios, count).sqrt())
    }
}

/// Returns by how many projector pixels a point's projection moves per millimetre of depth along its
/// camera ray.
pub(super) fn px_per_mm(rig: &Rig, px: DVec2, depth: f64, axis: Axis) -> f64 {
    let ray = rig.camera.ray(px);
    let step = depth * 1e-4;
    let at = |z: f64| project(&rig.projector, ray * z, axis);
    (at(depth + step) - at(depth - step)) / (2.0 * step)
}

fn project(view: &View, point: DVec3, axis: Axis) -> f64 {
    let px = view.project(point).unwrap_or(DVec2::NAN);
    match axis {
        Axis::X => px.x,
        Axis::Y => px.y,
    }
}

/// Returns the Hausdorff distance and the mean distance to agreement between the measured and the true
/// surface, without creases.
fn surfaces(decoded: &Decoded, truth: &Truth, rig: &Rig) -> Result<(f64, f64)> {
    let wanted = Truth::SEEN | Truth::LIT;
    let cloud = |depth: &[f32], keep: &dyn Fn(usize) -> bool| Cloud {
        points: (0..depth.len())
            .filter(|&i| depth[i].is_finite() && keep(i))
            .map(|i| {
                let px = DVec2::new((i % decoded.width) as f64, (i / decoded.width) as f64);
                (rig.camera.ray(px) * f64::from(depth[i]))
                    .as_vec3()
                    .to_array()
            })
            .collect(),
        ..Cloud::default()
    };
    let crease = |i: usize| truth.flags[i] & Truth::CREASE != 0;
    let measured = cloud(&decoded.depth, &|i| !crease(i));
    let exact = cloud(&truth.depth_mm, &|i| {
        !crease(i) && truth.flags[i] & wanted == wanted
    });
    if measured.points.is_empty() || exact.points.is_empty() {
        return Ok((f64::NAN, f64::NAN));
    }
    let exact = phasmid_measure::Truth::Cloud(exact);
    let surface = Surface::new(&exact)?;
    let comparison = compare(&measured, &exact, &surface, None)?;
    Ok(match comparison.both {
        Some(both) => (both.hausdorff_mm, both.mae_mm),
        None => (f64::NAN, f64::NAN),
    })
}
