//! One equation per measured point: its residual along the normal at its foot, and the derivative of
//! the residual with respect to the six unknowns.

use super::super::measured::Measured;
use super::super::surface::Reference;
use glam::DVec3;
use phasmid_geometry::Pose;
use rayon::prelude::*;

/// Number of points per parallel task.
pub(super) const CHUNK: usize = 512;

/// A point's equation: `residual_mm = jacobian . (shift, turn)`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    pub(super) normal: DVec3,
    /// Vector from the image of the isocentre to the point.
    pub(super) lever: DVec3,
    pub(super) residual_mm: f64,
    /// Standard deviation along the normal; infinite if the point is ignored.
    pub(super) sigma_mm: f64,
    pub(super) distance_mm: f64,
    pub(super) triangle: u32,
    pub(super) pod: u8,
}

impl Row {
    pub(super) fn counts(&self) -> bool {
        self.sigma_mm.is_finite()
    }

    /// Decrease of the residual per unit of shift (mm) and of turn (rad) of the reference about the
    /// image of the isocentre, both along the room's axes.
    pub(super) fn jacobian(&self) -> [f64; 6] {
        let turn = self.lever.cross(self.normal);
        let [a, b, c] = self.normal.to_array();
        let [d, e, f] = turn.to_array();
        [a, b, c, d, e, f]
    }

    /// Residual in units of its standard deviation.
    pub(super) fn whitened(&self) -> f64 {
        self.residual_mm / self.sigma_mm
    }
}

/// Which feet are used.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    /// Maximum distance of a point to its foot.
    pub(super) capture_mm: f64,
    /// Whether feet outside the region of interest are used.
    pub(super) anywhere: bool,
}

/// Computes the rows of all points for a pose of the reference. On entry, `rows` holds the rows for
/// the previous pose; the search for each foot starts at its previous triangle unless `afresh`.
pub(super) fn update(
    rows: &mut Vec<Row>,
    measured: &Measured,
    reference: &Reference,
    pose: &Pose,
    limits: Limits,
    afresh: bool,
) {
    let afresh = afresh || rows.len() != measured.len();
    let empty = Row {
        normal: DVec3::ZERO,
        lever: DVec3::ZERO,
        residual_mm: 0.0,
        sigma_mm: f64::INFINITY,
        distance_mm: f64::INFINITY,
        triangle: 0,
        pod: 0,
    };
    rows.resize(measured.len(), empty);
    let back = pose.inverse();
    rows.par_chunks_mut(CHUNK)
        .enumerate()
        .for_each(|(chunk, rows)| {
            for (k, row) in rows.iter_mut().enumerate() {
                let i = chunk * CHUNK + k;
                let p = measured.points[i];
                let q = back.point(p);
                let foot = if afresh {
                    reference.closest(q)
                } else {
                    reference.closest_near(q, row.triangle)
                };
                let normal = pose.direction(foot.normal);
                let pod = measured.pod[i];
                let distance_mm = (q - foot.point).length();
                let counts = measured.faces(i, normal)
                    && !foot.border
                    && distance_mm <= limits.capture_mm
                    && (limits.anywhere || reference.is_inside(foot.triangle));
                *row = Row {
                    normal,
                    lever: p - pose.translation_mm,
                    residual_mm: foot.normal.dot(q - foot.point)
                        - measured.lift_mm(i, &foot, reference, pose),
                    sigma_mm: if counts {
                        measured.sigma_along(i, normal)
                    } else {
                        f64::INFINITY
                    },
                    distance_mm,
                    triangle: foot.triangle,
                    pod,
                };
            }
        });
}
