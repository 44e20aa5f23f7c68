//! The points measured by a scan, in the room frame.

use super::surface::{Foot, Reference};
use glam::DVec3;
use phasmid_geometry::Pose;

/// Minimum standard deviation in millimetres, so that weights stay finite.
const LEAST_SIGMA_MM: f64 = 1e-3;
/// Number of points used while far from the solution.
const SOME: usize = 1500;
/// Minimum fraction of the standard deviation along the ray that applies along the normal, however
/// oblique the ray.
const LEAST_COSINE: f64 = 0.2;

/// The points of one scan by all pods, as arrays of equal length, in the room frame with its origin
/// at the isocentre.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Measured {
    /// Positions in millimetres, finite.
    pub(super) points: Vec<DVec3>,
    /// Standard deviation of each point in millimetres: along the ray from its pod if the camera
    /// position is known, otherwise along any direction.
    pub(super) sigma_mm: Vec<f64>,
    /// Pod that measured the point: an index into `eyes`.
    pub(super) pod: Vec<u8>,
    /// Camera position of each pod, in millimetres; `None` if unknown.
    pub(super) eyes: Vec<Option<DVec3>>,
}

impl Measured {
    /// Creates measured points of unknown source with the same standard deviation for all. Points
    /// that are not finite are omitted, and all points if the standard deviation is not positive.
    pub fn isotropic(points: Vec<DVec3>, sigma_mm: f64) -> Self {
        let mut measured = Self {
            eyes: vec![None],
            ..Self::default()
        };
        for p in points {
            measured.push(p, sigma_mm, 0);
        }
        measured
    }

    /// Adds a pod's point cloud: points in its rig's frame and the standard deviations of their
    /// depths, both in millimetres.
    ///
    /// Points that are not finite, or whose standard deviation is NaN or not positive (unknown), are
    /// omitted. At most `most` points are taken, evenly along the cloud. There are at most 256 pods;
    /// clouds of further pods are ignored.
    pub fn push_pod(
        &mut self,
        points: &[[f32; 3]],
        depth_sigma_mm: &[f32],
        room_from_rig: &Pose,
        most: usize,
    ) {
        let Ok(pod) = u8::try_from(self.eyes.len()) else {
            return;
        };
        self.eyes.push(Some(room_from_rig.translation_mm));
        let count = points.len().min(depth_sigma_mm.len());
        let taken = count.min(most);
        self.points.reserve(taken);
        for k in 0..taken {
            let i = k * count / taken;
            let p = DVec3::from_array(points[i].map(f64::from));
            // Convert the standard deviation of the depth to the standard deviation along the ray.
            let sigma = f64::from(depth_sigma_mm[i]) * p.length() / p.z.abs();
            self.push(room_from_rig.point(p), sigma, pod);
        }
    }

    fn push(&mut self, p: DVec3, sigma_mm: f64, pod: u8) {
        if p.is_finite() && sigma_mm.is_finite() && sigma_mm > 0.0 {
            self.points.push(p);
            self.sigma_mm.push(sigma_mm.max(LEAST_SIGMA_MM));
            self.pod.push(pod);
        }
    }

    /// Returns the positions in millimetres.
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Returns the index of the pod of each point, in the order of the calls of [`Self::push_pod`].
    pub fn pods(&self) -> &[u8] {
        &self.pod
    }

    /// Returns the number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Returns whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// A subset of the points for the steps with a [wide](super::robust::Spread::Wide) scale; the
    /// final steps use all. `None` if there are few points.
    pub(super) fn some(&self) -> Option<Self> {
        (self.len() > 2 * SOME).then(|| self.thinned(SOME))
    }

    /// Returns at most `most` of the points, at even intervals of their index.
    #[must_use]
    pub fn thinned(&self, most: usize) -> Self {
        let count = self.len();
        let taken = count.min(most);
        let chosen = || (0..taken).map(|k| k * count / taken);
        Self {
            points: chosen().map(|i| self.points[i]).collect(),
            sigma_mm: chosen().map(|i| self.sigma_mm[i]).collect(),
            pod: chosen().map(|i| self.pod[i]).collect(),
            eyes: self.eyes.clone(),
        }
    }

    /// Standard deviation in millimetres of point `i` along a unit normal.
    #[inline]
    pub(super) fn sigma_along(&self, i: usize, normal: DVec3) -> f64 {
        match self.eyes[usize::from(self.pod[i])] {
            Some(eye) => {
                let ray = (self.points[i] - eye).normalize_or_zero();
                self.sigma_mm[i] * ray.dot(normal).abs().max(LEAST_COSINE)
            }
            None => self.sigma_mm[i],
        }
    }

    /// Whether the pod of point `i` sees the front of a surface with this outward normal.
    #[inline]
    pub(super) fn faces(&self, i: usize, normal: DVec3) -> bool {
        let eye = self.eyes[usize::from(self.pod[i])];
        eye.is_none_or(|eye| normal.dot(eye - self.points[i]) > 0.0)
    }

    /// Mean distance by which noise shifts point `i` off the curved surface at its foot, in
    /// millimetres; the reference has the pose `room_from_reference`.
    #[inline]
    pub(super) fn lift_mm(
        &self,
        i: usize,
        foot: &Foot,
        reference: &Reference,
        room_from_reference: &Pose,
    ) -> f64 {
        match self.eyes[usize::from(self.pod[i])] {
            Some(eye) => {
                let ray = (self.points[i] - eye).normalize_or_zero();
                let along = room_from_reference.rotation.transpose() * ray;
                reference.lift_along_mm(foot.triangle, self.sigma_mm[i], along)
            }
            None => reference.lift_mm(foot.triangle, self.sigma_mm[i]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cloud_is_thinned_evenly_and_cleaned() {
        let points: Vec<[f32; 3]> = (0..100).map(|i| [i as f32, 0.0, 1000.0]).collect();
        let mut sigma = vec![0.1_f32; 100];
        sigma[20] = f32::NAN;
        sigma[40] = 0.0;
        let mut measured = Measured::default();
        let room_from_rig = Pose {
            translation_mm: DVec3::new(0.0, 5.0, 0.0),
            ..Pose::IDENTITY
        };
        measured.push_pod(&points, &sigma, &room_from_rig, 10);
        assert_eq!(measured.len(), 8);
        assert_eq!(measured.points[1], DVec3::new(10.0, 5.0, 1000.0));
        // Along the ray, the standard deviation equals that of the depth; across it, the minimum of
        // a fifth applies.
        assert!((measured.sigma_along(0, DVec3::Z) - 0.1).abs() < 1e-6);
        assert!((measured.sigma_along(0, DVec3::X) - 0.02).abs() < 1e-6);
        assert_eq!(measured.thinned(3).points[2].x, 70.0);
        measured.push_pod(&[[f32::INFINITY, 0.0, 1.0]], &[0.1], &Pose::IDENTITY, 10);
        assert_eq!((measured.len(), measured.eyes.len()), (8, 2));
    }
}
