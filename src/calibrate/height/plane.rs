//! The reference plane, fitted to what has been measured of it.

use glam::{DMat3, DVec3};

/// Fewest pixels that make a plane.
const FEWEST: usize = 100;
/// Rounds of leaving out what is off.
const ROUNDS: usize = 4;
/// Deviations (by the median of absolute residuals) beyond which a pixel is left out.
const OFF: f64 = 4.0;

/// A plane in the camera's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Unit normal towards the camera.
    pub normal: DVec3,
    /// Distance of the camera's pupil from the plane, in mm.
    pub distance_mm: f64,
}

impl Plane {
    /// The plane across the camera's axis at `z_mm`.
    pub fn across(z_mm: f64) -> Self {
        Self {
            normal: DVec3::NEG_Z,
            distance_mm: z_mm,
        }
    }

    /// The depth z in mm at which a camera's ray (with z = 1) is `height_mm` over the plane.
    pub fn depth_mm(&self, ray: DVec3, height_mm: f64) -> f64 {
        (self.distance_mm - height_mm) / -self.normal.dot(ray)
    }

    /// How high a point of the camera's frame is over the plane, in mm.
    pub fn height_mm(&self, p: DVec3) -> f64 {
        self.distance_mm + self.normal.dot(p)
    }

    /// Least squares through depths along rays (with z = 1), each with its standard deviation, in mm;
    /// what is off is left out. The plane and the root of the mean squared distance of what is left
    /// from it in mm. `None` where there is too little, less than half, or what spans no plane.
    ///
    /// The inverse depth is linear in the ray, `1/z = a . ray` with `a = -normal / distance`, so one
    /// solution of normal equations is the fit, weights and all.
    pub fn fit(samples: &[(DVec3, f64, f64)]) -> Option<(Self, f64)> {
        let good = |&&(_, z, s): &&(DVec3, f64, f64)| z > 0.0 && s > 0.0 && (z / s).is_finite();
        let samples: Vec<_> = samples.iter().filter(good).collect();
        let mut bound = f64::INFINITY;
        let mut found: Option<DVec3> = None;
        for _ in 0..ROUNDS {
            // Residuals of the inverse depth over its own deviation, s / z^2.
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
            let middle = sizes.len() / 2;
            let median = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
            bound = OFF * 1.4826 * median.max(1e-9);
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
