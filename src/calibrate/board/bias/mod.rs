//! Computes the offset between the centroid of an imaged dot and the image of its centre.
//!
//! Perspective enlarges the nearer half of a tilted disc, and lens distortion adds to the offset
//! (Heikkila, "Geometric camera calibration using circular control points", IEEE PAMI 22, 2000).
//! The centroid of the imaged area is the integral over the disc of the image point times the
//! Jacobian determinant of the projection, divided by the integral of the determinant. In polar
//! coordinates the integrand is smooth and, in the angle, periodic. Equal steps of the angle and
//! Gauss-Legendre nodes in the squared radius are exact to rounding for any disc that is small
//! compared to its distance, with any pose and lens.

use glam::{DMat2, DVec2};
use phasmid_geometry::{Lens, Pose};
use std::f64::consts::TAU;

/// Five Gauss-Legendre nodes on [0, 1] and their weights (Abramowitz and Stegun, table 25.4).
const NODES: [(f64, f64); 5] = [
    (0.046_910_077_030_668_0, 0.118_463_442_528_094_5),
    (0.230_765_344_947_158_5, 0.239_314_335_249_683_2),
    (0.5, 0.284_444_444_444_444_4),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_2),
    (0.953_089_922_969_332, 0.118_463_442_528_094_5),
];
/// Number of steps of the angle.
const STEPS: usize = 24;

/// Computes the centroid of a disc's image minus the image of its centre, in pixels.
///
/// `centre_mm` and `radius_mm` are in the board's frame. Returns `None` if a part of the disc is
/// not in front of the lens, or is outside the valid range of the distortion.
pub fn of_disc(
    lens: &Lens,
    camera_from_board: &Pose,
    centre_mm: DVec2,
    radius_mm: f64,
) -> Option<DVec2> {
    let (centre_px, _) = image(lens, camera_from_board, centre_mm)?;
    let (mut sum, mut area) = (DVec2::ZERO, 0.0);
    for (square, weight) in NODES {
        for k in 0..STEPS {
            let direction = DVec2::from_angle(TAU * k as f64 / STEPS as f64);
            let mm = centre_mm + direction * (square.sqrt() * radius_mm);
            let (px, slope) = image(lens, camera_from_board, mm)?;
            let part = slope.determinant() * weight;
            sum += (px - centre_px) * part;
            area += part;
        }
    }
    let bias = sum / area;
    bias.is_finite().then_some(bias)
}

/// Returns the image of a board point in pixels and the derivative of that image with respect to
/// the point (pixels per millimetre); `None` if the point cannot be projected.
pub(crate) fn image(lens: &Lens, camera_from_board: &Pose, mm: DVec2) -> Option<(DVec2, DMat2)> {
    let p = camera_from_board.point(mm.extend(0.0));
    let px = lens.project(p)?;
    let ideal = p.truncate() / p.z;
    let turn = &camera_from_board.rotation;
    let by = [turn.x_axis, turn.y_axis].map(|d| (d.truncate() - ideal * d.z) / p.z);
    let slope = DMat2::from_diagonal(lens.focal_px)
        * lens.distort_jacobian(ideal)
        * DMat2::from_cols(by[0], by[1]);
    (px.is_finite() && slope.is_finite()).then_some((px, slope))
}

#[cfg(test)]
mod tests;
