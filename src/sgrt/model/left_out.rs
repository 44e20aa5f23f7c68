//! Effect on the tumour of the components that the model leaves out.

use super::MotionModel;
use glam::{DVec3, Vec3};
use nalgebra::DMatrix;

/// Mean square displacement along the normals, in square millimetres, below which a scan of a
/// thousand points with 0.2 mm of noise does not detect a component.
const UNSEEN_MM2: f64 = 1e-5;

impl MotionModel {
    /// Computes, for a coefficient of 1 of each left-out component, the error of the fitted tumour
    /// centroid, in millimetres. `region` lists the region's vertices with outward normals.
    ///
    /// A left-out component moves the tumour, and it moves the skin, which the fit explains by the
    /// best combination of the kept components. Where a tumour lags behind the skin and no kept
    /// component describes this, the second effect is the larger one.
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
        // A component that this skin hardly shows is held by its prior instead of compensating for
        // others.
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
