//! Triangulates depth from a camera pixel and the projector column, row or both that lit it.
//!
//! A camera ray o + t d (d with z = 1 in the camera's frame, so t is the depth) becomes a + t b in
//! the projector's frame. There, a column with ideal image coordinate xn is the plane X = xn Z, so t
//! = (xn a_z - a_x) / (b_x - xn b_z); likewise for a row. With projector distortion, or with both
//! axes, t minimises the squared differences between the projected point and the decoded coordinates,
//! weighted by their variances, by Gauss-Newton on 1/t starting from the plane's t.
//!
//! Rows without distortion are solved in closed form here, single rays iteratively in `ray`. The
//! covariance of the calibration is carried to depth.

mod ray;
#[cfg(test)]
mod tests;

use glam::{DMat3, DVec2, DVec3};
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{Pose, Rig};
use phasmid_pattern::Axis;
use rayon::prelude::*;

/// Maximum relative standard deviation (sigma / depth) of a triangulated depth. Above it the depth is
/// rejected.
pub const WORST_RELATIVE_SIGMA: f64 = 0.05;

/// Maximum depth in mm: excludes parallel rays and values that f32 cannot represent.
pub(crate) const FARTHEST_MM: f64 = f32::MAX as f64;

/// A decoded projector coordinate with its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Coordinate in projector pixels.
    pub px: f64,
    /// Standard deviation in projector pixels.
    pub sigma: f64,
}

/// One row of decoded coordinates and standard deviations; NaN where invalid.
#[derive(Debug, Clone, Copy)]
pub struct CoordinateRow<'a> {
    /// Coordinates in projector pixels.
    pub px: &'a [f32],
    /// Standard deviations in projector pixels.
    pub sigma: &'a [f32],
}

/// A rig with a table of its camera's rays; created once and used for every scan.
#[derive(Debug, Clone)]
pub struct Triangulator {
    rig: Rig,
    width: usize,
    /// X/Z and Y/Z of each camera pixel's ray.
    rays: [Vec<f32>; 2],
    /// Whether the camera's frame is the rig's frame, so that points need no transform.
    camera_is_rig: bool,
    /// Optical centre of the camera in the projector's frame.
    origin: DVec3,
    /// Rotates directions from the camera's frame to the projector's.
    turn: DMat3,
}

impl Triangulator {
    /// Tabulates the rays of a rig's camera for images of `width` x `height`.
    ///
    /// # Errors
    /// Returns an error if the image size differs from that of the rig's camera.
    pub fn new(rig: &Rig, width: usize, height: usize) -> Result<Self> {
        let lens = &rig.camera.lens;
        if (lens.width_px as usize, lens.height_px as usize) != (width, height) {
            return Err(Error::input(
                "calibration: camera.lens.width_px/height_px",
                format!("{} x {}", lens.width_px, lens.height_px),
                format!("the frames' size, {width} x {height}"),
            ));
        }
        let mut rays = [vec![0.0f32; width * height], vec![0.0f32; width * height]];
        let [xs, ys] = &mut rays;
        xs.par_chunks_mut(width)
            .zip(ys.par_chunks_mut(width))
            .enumerate()
            .for_each(|(v, (xs, ys))| {
                for (u, (x, y)) in xs.iter_mut().zip(ys).enumerate() {
                    let ray = lens.ray(DVec2::new(u as f64, v as f64));
                    (*x, *y) = (ray.x as f32, ray.y as f32);
                }
            });
        Ok(Self::with_rays(rig, width, rays))
    }

    fn with_rays(rig: &Rig, width: usize, rays: [Vec<f32>; 2]) -> Self {
        let projector_from_rig = rig.projector.rig_from_view.inverse();
        let projector_from_camera = projector_from_rig * rig.camera.rig_from_view;
        Self {
            rig: *rig,
            width,
            rays,
            camera_is_rig: rig.camera.rig_from_view == Pose::IDENTITY,
            origin: projector_from_camera.translation_mm,
            turn: projector_from_camera.rotation,
        }
    }

    /// Returns the rig.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Computes depths and standard deviations, in mm, of row `v` of the image; NaN where invalid.
    #[inline(always)]
    pub fn row(
        &self,
        v: usize,
        x: Option<CoordinateRow<'_>>,
        y: Option<CoordinateRow<'_>>,
        depth: &mut [f32],
        sigma: &mut [f32],
    ) {
        if !self.rig.projector.lens.is_distorted() {
            match (x, y) {
                (Some(x), None) => return self.plane_row(v, Axis::X, x, depth, sigma),
                (None, Some(y)) => return self.plane_row(v, Axis::Y, y, depth, sigma),
                _ => {}
            }
        }
        let at = v * self.width;
        let measured = |row: Option<CoordinateRow<'_>>, u: usize| {
            row.map(|r| Measured {
                px: f64::from(r.px[u]),
                sigma: f64::from(r.sigma[u]),
            })
            .filter(|m| !m.px.is_nan())
        };
        for u in 0..depth.len() {
            let ray = self.rays.each_ref().map(|r| f64::from(r[at + u]));
            let found = self.solve(ray.into(), measured(x, u), measured(y, u));
            let (t, s) = found.unwrap_or((f64::NAN, f64::NAN));
            (depth[u], sigma[u]) = (t as f32, s as f32);
        }
    }

    /// Computes the point at a depth along the ray of pixel (u, v), in the rig's frame in mm.
    #[inline(always)]
    pub fn point(&self, u: usize, v: usize, depth: f32) -> [f32; 3] {
        let i = v * self.width + u;
        if self.camera_is_rig {
            return [self.rays[0][i] * depth, self.rays[1][i] * depth, depth];
        }
        let local = DVec3::new(f64::from(self.rays[0][i]), f64::from(self.rays[1][i]), 1.0);
        let view = &self.rig.camera.rig_from_view;
        view.point(local * f64::from(depth)).as_vec3().to_array()
    }

    /// Writes the points of row `v` whose depth is not NaN into `points`, which must have exactly that
    /// many elements.
    pub fn points_row(&self, v: usize, depth: &[f32], points: &mut [[f32; 3]]) {
        let at = v * self.width;
        let (rx, ry) = (&self.rays[0][at..], &self.rays[1][at..]);
        let mut next = points.iter_mut();
        for (u, ((&z, &x), &y)) in depth.iter().zip(rx).zip(ry).enumerate() {
            if z.is_nan() {
                continue;
            }
            let Some(point) = next.next() else { return };
            *point = if self.camera_is_rig {
                [x * z, y * z, z]
            } else {
                self.point(u, v, z)
            };
        }
    }
}

impl Triangulator {
    /// Intersects each pixel's ray with its plane. The parallax is a difference of nearly equal
    /// directions: f32 arithmetic causes errors of up to 1.6e-3 mm at 1.6 m (measured with the test's
    /// rig), f64 arithmetic on f32 rays and coordinates a sixth of that.
    #[inline(always)]
    fn plane_row(
        &self,
        v: usize,
        axis: Axis,
        row: CoordinateRow<'_>,
        depth: &mut [f32],
        sigma: &mut [f32],
    ) {
        let n = depth.len();
        let at = v * self.width;
        let (rx, ry) = (&self.rays[0][at..at + n], &self.rays[1][at..at + n]);
        let (px, sd) = (&row.px[..n], &row.sigma[..n]);
        let sigma = &mut sigma[..n];
        let k = axis as usize;
        let lens = &self.rig.projector.lens;
        let (inverse_focal, center) = (1.0 / lens.focal_px[k], lens.principal_px[k]);
        let (a, az) = (self.origin[k], self.origin.z);
        let ([m0, m1, m2], [z0, z1, z2]) =
            (self.turn.row(k).to_array(), self.turn.row(2).to_array());
        for u in 0..n {
            let (rx, ry) = (f64::from(rx[u]), f64::from(ry[u]));
            let b = m0 * rx + m1 * ry + m2;
            let bz = z0 * rx + z1 * ry + z2;
            let xn = (f64::from(px[u]) - center) * inverse_focal;
            let parallax = 1.0 / (b - xn * bz);
            let t = (xn * az - a) * parallax;
            let slope = (az * b - a * bz) * inverse_focal * (parallax * parallax);
            let s = slope.abs() * f64::from(sd[u]);
            // NaN fails all these comparisons.
            let ahead = (t > 0.0) & (t < FARTHEST_MM) & (az + t * bz > 0.0);
            let good = ahead & (s <= WORST_RELATIVE_SIGMA * t);
            depth[u] = if good { t as f32 } else { f32::NAN };
            sigma[u] = if good { s as f32 } else { f32::NAN };
        }
    }
}

/// A camera pixel and the projector coordinates that lit it, along x and along y.
pub type Lit = ([f64; 2], [Option<Measured>; 2]);

impl Triangulator {
    /// Computes the standard deviation in mm that errors of the calibration cause in the depth of each
    /// pixel, to first order, from the covariance of the rig. These errors are common to all scans and
    /// nearly equal at neighbouring pixels; the sigma of noise does not contain them. NaN where a pixel
    /// has no depth; infinite where it has no depth with a rig that is one standard deviation off;
    /// `None` if the rig has no covariance.
    pub fn calibration_sigma(&self, pixels: &[Lit]) -> Option<Vec<f64>> {
        let covariance = self.rig.covariance.as_ref()?;
        // Effects of independent steps add up in squares.
        let pairs: Vec<[Self; 2]> = covariance
            .steps()
            .map(|step| {
                [1.0, -1.0].map(|sign| Self::bare(&self.rig.stepped(&step.map(|s| sign * s))))
            })
            .collect();
        let sigma = pixels.par_iter().map(|(px, [x, y])| {
            let depth = |of: &Self| of.depth(*px, *x, *y).map_or(f64::NAN, |(depth, _)| depth);
            let effect = |[up, down]: &[Self; 2]| 0.5 * (depth(up) - depth(down));
            if depth(self).is_nan() {
                return f64::NAN;
            }
            let square: f64 = pairs.iter().map(|pair| effect(pair).powi(2)).sum();
            if square.is_nan() {
                f64::INFINITY
            } else {
                square.sqrt()
            }
        });
        Some(sigma.collect())
    }

    /// Creates a triangulator without a table of rays; only [`Self::depth`] may be used with it.
    fn bare(rig: &Rig) -> Self {
        Self::with_rays(rig, 0, [Vec::new(), Vec::new()])
    }
}
