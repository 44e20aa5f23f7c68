//! The reference surface deformed by the model, and one equation per measured point.
//!
//! Feet are not searched on the deformed mesh, which has no grid of start triangles. Instead a point
//! is moved back by the displacement at its previous foot, and the foot found on the reference is
//! displaced. For a point on the deformed surface this converges to the exact point of the triangle
//! that it came from, because displacements are interpolated within triangles like positions.

use super::super::measured::Measured;
use super::super::model::{MOST_COMPONENTS, MotionModel};
use super::super::surface::{Foot, Reference};
use glam::{DVec3, Vec3};
use phasmid_geometry::Pose;
use rayon::prelude::*;

/// Number of points per parallel task.
pub(super) const CHUNK: usize = 256;
/// Maximum number of unknowns: components, shift and turn.
pub(super) const MOST: usize = MOST_COMPONENTS + 6;
/// Number of iterations in the first search, each of which displaces a foot and searches it again.
/// Displacements vary slowly: each iteration reduces the foot's error by the factor of their gradient, a
/// tenth or less.
const ROUNDS: usize = 3;

/// A point's equation: `residual_mm = jacobian . unknowns`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    pub(super) jacobian: [f64; MOST],
    pub(super) residual_mm: f64,
    /// Standard deviation along the normal; infinite if the point is ignored.
    pub(super) sigma_mm: f64,
    pub(super) triangle: u32,
    weights: [f64; 3],
}

impl Row {
    pub(super) fn counts(&self) -> bool {
        self.sigma_mm.is_finite()
    }
}

/// The reference deformed by given coefficients.
pub(super) struct Moved<'a> {
    pub(super) reference: &'a Reference,
    pub(super) model: &'a MotionModel,
    /// Displacement of each vertex in millimetres.
    shifts: Vec<Vec3>,
}

impl<'a> Moved<'a> {
    pub(super) fn new(
        reference: &'a Reference,
        model: &'a MotionModel,
        coefficients: &[f64],
    ) -> Self {
        let shifts = (0..model.skin_vertices())
            .into_par_iter()
            .with_min_len(4096)
            .map(|v| model.skin(v, coefficients))
            .collect();
        Self {
            reference,
            model,
            shifts,
        }
    }

    fn shift(&self, triangle: u32, weights: [f64; 3]) -> DVec3 {
        let t = self.reference.triangles()[triangle as usize];
        let [a, b, c] = t.map(|v| self.shifts[v as usize].as_dvec3());
        a * weights[0] + b * weights[1] + c * weights[2]
    }

    /// The smooth normal at a foot, rotated with its triangle (to first order).
    fn normal(&self, foot: &Foot) -> DVec3 {
        let t = self.reference.triangles()[foot.triangle as usize];
        let at = t.map(|v| self.reference.vertices()[v as usize]);
        let to: [DVec3; 3] = std::array::from_fn(|k| at[k] + self.shifts[t[k] as usize].as_dvec3());
        let flat = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a).normalize_or_zero();
        (foot.normal + flat(to) - flat(at)).normalize_or_zero()
    }

    /// Computes the rows of all points. On entry, `rows` holds the rows for the previous
    /// coefficients, if any.
    pub(super) fn rows(
        &self,
        rows: &mut Vec<Row>,
        measured: &Measured,
        pose: &Pose,
        capture_mm: f64,
        with_pose: bool,
    ) {
        let afresh = rows.len() != measured.len();
        let empty = Row {
            jacobian: [0.0; MOST],
            residual_mm: 0.0,
            sigma_mm: f64::INFINITY,
            triangle: 0,
            weights: [0.0; 3],
        };
        rows.resize(measured.len(), empty);
        let back = pose.inverse();
        rows.par_chunks_mut(CHUNK)
            .enumerate()
            .for_each(|(chunk, rows)| {
                for (k, row) in rows.iter_mut().enumerate() {
                    let i = chunk * CHUNK + k;
                    let q = back.point(measured.points[i]);
                    let foot = self.foot(q, row, afresh);
                    self.fill(row, measured, i, q, &foot, pose, capture_mm, with_pose);
                }
            });
    }

    fn foot(&self, q: DVec3, last: &Row, afresh: bool) -> Foot {
        if !afresh {
            let shift = self.shift(last.triangle, last.weights);
            return self.reference.closest_near(q - shift, last.triangle);
        }
        let mut foot = self.reference.closest(q);
        for _ in 0..ROUNDS {
            let shift = self.shift(foot.triangle, foot.weights);
            foot = self.reference.closest_near(q - shift, foot.triangle);
        }
        foot
    }

    #[allow(clippy::too_many_arguments)] // all of a point
    #[inline]
    fn fill(
        &self,
        row: &mut Row,
        measured: &Measured,
        i: usize,
        q: DVec3,
        foot: &Foot,
        pose: &Pose,
        capture_mm: f64,
        with_pose: bool,
    ) {
        (row.triangle, row.weights) = (foot.triangle, foot.weights);
        let normal = self.normal(foot);
        let off = q - foot.point - self.shift(foot.triangle, foot.weights);
        let outward = pose.direction(normal);
        if foot.border
            || !self.reference.is_inside(foot.triangle)
            || off.length() > capture_mm
            || !measured.faces(i, outward)
        {
            row.sigma_mm = f64::INFINITY;
            return;
        }
        row.sigma_mm = measured.sigma_along(i, outward);
        row.residual_mm = normal.dot(off) - measured.lift_mm(i, foot, self.reference, pose);
        let t = self.reference.triangles()[foot.triangle as usize];
        let modes = t.map(|v| self.model.skin_modes(v as usize));
        let count = self.model.components();
        let single = normal.as_vec3();
        for k in 0..count {
            let along = |corner: usize| f64::from(modes[corner][k].dot(single));
            row.jacobian[k] = (0..3).map(|c| foot.weights[c] * along(c)).sum();
        }
        if with_pose {
            let lever = measured.points[i] - pose.translation_mm;
            let turn = lever.cross(outward);
            row.jacobian[count..count + 3].copy_from_slice(&outward.to_array());
            row.jacobian[count + 3..count + 6].copy_from_slice(&turn.to_array());
        }
    }
}
