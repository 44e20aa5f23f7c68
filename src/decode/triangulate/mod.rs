//! Triangulates depth from a camera pixel and the projector column, row or both that lit it.
//!
//! A camera ray o + t d (d with z = 1 in the camera's frame, so t is the depth) becomes a + t b in
//! the projector's frame. There, a column with ideal image coordinate xn is the plane X = xn Z, so t
//! = (xn a_z - a_x) / (b_x - xn b_z); likewise for a row. With projector distortion, or with both
//! axes, t minimises the squared differences between the projected point and the decoded coordinates,
//! weighted by their variances, by Gauss-Newton on 1/t starting from the plane's t.
//!
//! `plane` solves rows in closed form; `ray` solves single rays iteratively; `calibration` carries the
//! covariance of the calibration to depth.

mod calibration;
mod plane;
mod ray;
#[cfg(test)]
mod tests;

pub use calibration::Lit;

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

    /// Writes the points of row `v` whose depth is not NaN into `points`, whose length must be their
    /// number.
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
