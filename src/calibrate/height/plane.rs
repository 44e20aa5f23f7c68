//! The reference plane and its robust fit to measured depths.

use glam::{DMat3, DVec3};
use phasmid_core::statistics::normal_scale;

/// Minimum number of pixels for a fit.
const FEWEST: usize = 100;
/// Number of fits, each without the outliers of the previous fit.
const ROUNDS: usize = 4;
/// Outlier threshold in standard deviations, which are estimated from the median absolute residual.
const OFF: f64 = 4.0;

/// A plane in the camera's frame: the points p with `normal . p = -distance_mm`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Unit normal towards the camera.
    pub normal: DVec3,
    /// Distance of the camera's pupil from the plane, in mm.
    pub distance_mm: f64,
}

impl Plane {
    /// Returns the plane perpendicular to the camera's axis at depth `z_mm`.
    pub fn across(z_mm: f64) -> Self {
        Self {
            normal: DVec3::NEG_Z,
            distance_mm: z_mm,
        }
    }

    /// Returns the depth z in mm at which a camera ray (with z = 1) is `height_mm` above the plane.
    pub fn depth_mm(&self, ray: DVec3, height_mm: f64) -> f64 {
        (self.distance_mm - height_mm) / -self.normal.dot(ray)
    }

    /// Returns the height in mm of a point (in the camera's frame) above the plane.
    pub fn height_mm(&self, p: DVec3) -> f64 {
        self.distance_mm + self.normal.dot(p)
    }

    /// Fits a plane to depths along rays, by weighted least squares without outliers. Each sample
    /// is a ray (with z = 1), a depth and its standard deviation, both in mm. Returns the plane and
    /// the RMS distance of the inliers from it, in mm, or `None` if there are too few samples, if
    /// less than half are inliers, or if the samples do not span a plane.
    ///
    /// The inverse depth is linear in the ray, `1/z = a . ray` with `a = -normal / distance`, so
    /// each fit takes a single solution of the normal equations.
    pub fn fit(samples: &[(DVec3, f64, f64)]) -> Option<(Self, f64)> {
        let good = |&&(_, z, s): &&(DVec3, f64, f64)| z > 0.0 && s > 0.0 && (z / s).is_finite();
        let samples: Vec<_> = samples.iter().filter(good).collect();
        let mut bound = f64::INFINITY;
        let mut found: Option<DVec3> = None;
        for _ in 0..ROUNDS {
            // Residual of the inverse depth over its standard deviation, s / z^2.
            let residual =
                |a: DVec3, &&(ray, z, s): &&(DVec3, f64, f64)| (1.0 - z * a.dot(ray)) * z / s;
            let (mut normal_matrix, mut right, mut count) = ([[0.0; 3]; 3], DVec3::ZERO, 0);
            for sample in &samples {
                if found.is_some_and(|a| !(residual(a, sample).abs() <= bound)) {
                    continue;
                }
                let (ray, z, s) = **sample;
                let weight = (z / s * z).powi(2);
                for (i, row) in normal_matrix.iter_mut().enumerate() {
                    for (j, entry) in row.iter_mut().enumerate() {
                        *entry += weight * ray[i] * ray[j];
                    }
                }
                right += ray * (weight / z);
                count += 1;
            }
            let matrix = DMat3::from_cols_array_2d(&normal_matrix);
            let trace = matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z;
            if count < FEWEST || !(matrix.determinant() > 1e-15 * trace.powi(3)) {
                return None;
            }
            let a = matrix.inverse() * right;
            let mut sizes: Vec<f64> = samples.iter().map(|p| residual(a, p).abs()).collect();
            bound = OFF * normal_scale(&mut sizes)?.max(1e-9);
            found = Some(a);
        }
        let a = found?;
        let plane = Self {
            normal: -a.normalize_or_zero(),
            distance_mm: 1.0 / a.length(),
        };
        let kept = samples.iter().filter(|(ray, z, s)| {
            let off = (1.0 - z * a.dot(*ray)) * z / s;
            off.abs() <= bound
        });
        let (mut square, mut count) = (0.0, 0);
        for (ray, z, _) in kept {
            square += plane.height_mm(*ray * *z).powi(2);
            count += 1;
        }
        let rms = (square / f64::from(count)).sqrt();
        let most = 2 * count as usize >= samples.len();
        (most && plane.distance_mm.is_finite() && rms.is_finite()).then_some((plane, rms))
    }
}
