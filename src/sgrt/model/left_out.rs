//! What the components that are left out do to the tumour.

use super::MotionModel;
use glam::{DVec3, Vec3};
use nalgebra::DMatrix;

/// Mean square in square millimetres of a component's displacement along the normals below which a
/// scan, of a thousand points and 0.2 mm of noise, does not see it.
const UNSEEN_MM2: f64 = 1e-5;

impl MotionModel {
    /// What a coefficient of 1 of each component that is left out does to the tumour's centroid when
    /// the others are fitted to a skin of these outward normals (by vertex, the vertices of the
    /// region alone), in millimetres. It moves the tumour itself, and it moves the skin, which the
    /// fit takes for what the kept components do best in its place: where a tumour lags behind the
    /// skin and no kept component says so, the latter is the larger part.
    pub fn left_out(&self, region: &[(u32, DVec3)]) -> Vec<DVec3> {
        let (kept, rest) = (self.count, self.rest_centroid.len());
        if rest == 0 {
            return Vec::new();
        }
        let mut system = DMatrix::<f64>::zeros(kept, kept);
        let mut right = DMatrix::<f64>::zeros(kept, rest);
        for &(vertex, normal) in region {
            let (v, n) = (vertex as usize, normal.as_vec3());
            let along = |modes: &[Vec3]| -> Vec<f64> {
                modes.iter().map(|m| f64::from(m.dot(n))).collect()
            };
            let (a, b) = (
                along(self.skin_modes(v)),
                along(&self.skin_rest[v * rest..(v + 1) * rest]),
            );
            for i in 0..kept {
                (0..kept).for_each(|j| system[(i, j)] += a[i] * a[j]);
                (0..rest).for_each(|j| right[(i, j)] += a[i] * b[j]);
            }
        }
        // A component that this skin hardly shows is held by its prior, not by another's skin.
        for i in 0..kept {
            system[(i, i)] += UNSEEN_MM2 * region.len().max(1) as f64;
        }
        let Some(taken_for) = system.cholesky().map(|f| f.solve(&right)) else {
            return self.rest_centroid.clone();
        };
        (0..rest)
            .map(|b| {
                let instead = (0..kept).map(|a| self.centroid_modes[a] * taken_for[(a, b)]);
                self.rest_centroid[b] - instead.sum::<DVec3>()
            })
            .collect()
    }
}
