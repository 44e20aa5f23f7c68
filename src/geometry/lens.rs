//! The lens model: a pinhole with OpenCV's five Brown-Conrady coefficients, for cameras and, as
//! inverse cameras, for projectors.
//!
//! With x = X/Z, y = Y/Z and r2 = x^2 + y^2 (OpenCV documentation, "Camera Calibration and 3D
//! Reconstruction"):
//!
//! ```text
//! x' = x (1 + k1 r2 + k2 r2^2 + k3 r2^3) + 2 p1 x y + p2 (r2 + 2 x^2)
//! y' = y (1 + k1 r2 + k2 r2^2 + k3 r2^3) + p1 (r2 + 2 y^2) + 2 p2 x y
//! u = fx x' + cx,  v = fy y' + cy
//! ```
//!
//! Pixel centres are at integers.

use crate::{Vector2, Vector3};
use glam::{DMat2, DVec2};
use serde::{Deserialize, Serialize};

/// Intrinsics of a camera or projector.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lens {
    /// Image width in pixels.
    pub width_px: u32,
    /// Image height in pixels.
    pub height_px: u32,
    #[doc(hidden)]
    #[serde(deserialize_with = "phasmid_core::numbers::exactly")]
    pub focal_px: DVec2,
    #[doc(hidden)]
    #[serde(deserialize_with = "phasmid_core::numbers::exactly")]
    pub principal_px: DVec2,
    /// Distortion coefficients k1, k2, p1, p2, k3.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly")]
    pub distortion: [f64; 5],
}

impl Lens {
    /// Creates the intrinsics of an image of this width and height in pixels: focal lengths fx, fy and
    /// principal point cx, cy in pixels, and distortion coefficients k1, k2, p1, p2, k3.
    ///
    /// ```
    /// use phasmid_geometry::Lens;
    ///
    /// let lens = Lens::new([640, 480], [800.0, 800.0], [319.5, 239.5], [-0.1, 0.0, 0.0, 0.0, 0.0]);
    /// let px = lens.project([10.0, -20.0, 500.0]).unwrap();
    /// let [x, y, z] = lens.ray(px);
    /// assert!((x - 0.02).abs() < 1e-12 && (y + 0.04).abs() < 1e-12 && z == 1.0);
    /// ```
    pub fn new(
        [width_px, height_px]: [u32; 2],
        focal_px: [f64; 2],
        principal_px: [f64; 2],
        distortion: [f64; 5],
    ) -> Self {
        Self {
            width_px,
            height_px,
            focal_px: focal_px.into(),
            principal_px: principal_px.into(),
            distortion,
        }
    }

    /// Returns the focal lengths fx, fy in pixels.
    pub fn focal_px(&self) -> [f64; 2] {
        self.focal_px.to_array()
    }

    /// Returns the principal point cx, cy in pixels.
    pub fn principal_px(&self) -> [f64; 2] {
        self.principal_px.to_array()
    }

    /// Returns whether any distortion coefficient is non-zero.
    #[inline]
    pub fn is_distorted(&self) -> bool {
        self.distortion.iter().any(|&k| k != 0.0)
    }

    /// Returns the pixel that sees (or illuminates) a point in the lens's frame, in millimetres;
    /// `None` if the point is not in front of the lens, or so far off axis that the distortion
    /// polynomial folds it back into the image.
    #[inline]
    pub fn project<V: Vector3>(&self, p: V) -> Option<V::Image> {
        let p = p.to_glam();
        let px = (p.z > 0.0).then(|| self.place(p.truncate() / p.z));
        px.flatten().map(V::Image::from_glam)
    }

    /// Returns the pixel of the ideal image point (X/Z, Y/Z); `None` where the polynomial folds
    /// back into the image, which a real lens does not do.
    #[inline]
    pub fn place<V: Vector2>(&self, ideal: V) -> Option<V> {
        let ideal = ideal.to_glam();
        let px = self.distort_to_px(ideal);
        let folded = self.is_distorted() && self.contains(px) && !self.is_unfolded(ideal);
        (!folded).then(|| V::from_glam(px))
    }

    /// Returns the pixel of the ideal image point (X/Z, Y/Z) without the fold check of
    /// [`Self::place`].
    #[inline]
    pub fn distort_to_px<V: Vector2>(&self, ideal: V) -> V {
        V::from_glam(self.focal_px * self.distort(ideal.to_glam()) + self.principal_px)
    }

    /// Returns the direction, with z = 1, of the ray through a pixel; NaN where the distortion
    /// cannot be inverted.
    #[inline]
    pub fn ray<V: Vector2>(&self, px: V) -> V::Space {
        let ideal = self.undistort((px.to_glam() - self.principal_px) / self.focal_px);
        V::Space::from_glam(ideal.extend(1.0))
    }

    /// Returns whether a pixel coordinate lies in the image, x in [-0.5, width - 0.5) and y
    /// likewise.
    #[inline]
    pub fn contains<V: Vector2>(&self, px: V) -> bool {
        let px = px.to_glam();
        px.x >= -0.5
            && px.y >= -0.5
            && px.x < f64::from(self.width_px) - 0.5
            && px.y < f64::from(self.height_px) - 0.5
    }

    /// Returns the distorted image point of an ideal image point, both in units of the focal length.
    #[inline]
    pub fn distort<V: Vector2>(&self, p: V) -> V {
        if !self.is_distorted() {
            return p;
        }
        let p = p.to_glam();
        let [k1, k2, p1, p2, k3] = self.distortion;
        let r2 = p.length_squared();
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let cross = 2.0 * p.x * p.y;
        let decentred = DVec2::new(
            p1 * cross + p2 * (r2 + 2.0 * p.x * p.x),
            p1 * (r2 + 2.0 * p.y * p.y) + p2 * cross,
        );
        V::from_glam(p * radial + decentred)
    }

    /// Returns the Jacobian of [`Self::distort`]; column j holds the derivatives by coordinate j.
    #[doc(hidden)]
    pub fn distort_jacobian(&self, p: DVec2) -> DMat2 {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let r2 = p.length_squared();
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        // d(radial)/d(r2), times 2 for d(r2)/dx = 2x.
        let slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));
        let off = p.x * p.y * slope + 2.0 * (p1 * p.x + p2 * p.y);
        DMat2::from_cols(
            DVec2::new(
                radial + p.x * p.x * slope + 2.0 * p1 * p.y + 6.0 * p2 * p.x,
                off,
            ),
            DVec2::new(
                off,
                radial + p.y * p.y * slope + 6.0 * p1 * p.y + 2.0 * p2 * p.x,
            ),
        )
    }

    /// Returns the ideal image point of a distorted point by Newton's method, exact to rounding. A
    /// result must be connected to the axis without crossing a fold; NaN if there is none.
    pub fn undistort<V: Vector2>(&self, d: V) -> V {
        if !self.is_distorted() {
            return d;
        }
        let d = d.to_glam();
        // Plain Newton steps from the distorted point nearly always converge; the result is
        // accepted only inside the disc without folds.
        V::from_glam(match self.newton(d) {
            Some(p) if self.is_unfolded(p) => p,
            _ => self.descend(d),
        })
    }

    fn newton(&self, d: DVec2) -> Option<DVec2> {
        let mut p = d;
        for _ in 0..50 {
            let jacobian = self.distort_jacobian(p);
            let residual = self.distort(p) - d;
            // A non-positive determinant means that the image has folded over.
            if jacobian.determinant() <= 1e-6 {
                return None;
            }
            let step = jacobian.inverse() * residual;
            p -= step;
            if step.length_squared() <= 1e-30 * (1.0 + p.length_squared()) {
                return Some(p);
            }
        }
        ((self.distort(p) - d).length() < 1e-12).then_some(p)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn lens(distortion: [f64; 5]) -> Lens {
        Lens {
            width_px: 1138,
            height_px: 489,
            focal_px: DVec2::splat(632.0),
            principal_px: DVec2::new(568.5, 244.0),
            distortion,
        }
    }

    #[test]
    fn projection_inverts_ray_over_the_image() {
        let lens = lens([-0.21, 0.08, 1.2e-3, -7e-4, -0.011]);
        for v in (0..489).step_by(16) {
            for u in (0..1138).step_by(16) {
                let px = DVec2::new(f64::from(u), f64::from(v));
                let back = lens.project(lens.ray(px) * 731.0).unwrap();
                assert!((back - px).length() < 1e-9, "{px} {back}");
            }
        }
    }

    #[test]
    fn jacobian_is_the_derivative() {
        let lens = lens([-0.21, 0.08, 1.2e-3, -7e-4, -0.011]);
        let (p, h) = (DVec2::new(0.4, -0.3), 1e-6);
        let j = lens.distort_jacobian(p);
        for (axis, col) in [(DVec2::X, j.x_axis), (DVec2::Y, j.y_axis)] {
            let numeric = (lens.distort(p + axis * h) - lens.distort(p - axis * h)) / (2.0 * h);
            assert!((numeric - col).length() < 1e-9);
        }
    }

    #[test]
    fn points_beyond_a_fold_or_behind_the_lens_are_refused() {
        // x (1 - r2) peaks at r = 1/sqrt(3) with 0.385: no ideal point maps beyond it.
        assert!(
            lens([-1.0, 0.0, 0.0, 0.0, 0.0])
                .undistort(DVec2::new(0.6, 0.0))
                .is_nan()
        );
        assert!(lens([0.0; 5]).project(DVec3::new(0.0, 0.0, -1.0)).is_none());
        // x' = x (1 - 0.3 x^2) rises up to x = 1.05 and is back at the image centre at 1.8.
        let barrel = lens([-0.3, 0.0, 0.0, 0.0, 0.0]);
        assert!(barrel.contains(barrel.distort_to_px(DVec2::new(1.8, 0.0))));
        assert!(barrel.project(DVec3::new(1.8, 0.0, 1.0)).is_none());
        assert!(barrel.project(DVec3::new(0.8, 0.0, 1.0)).is_some());
    }
}
