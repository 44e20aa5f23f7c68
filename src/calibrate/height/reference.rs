//! The reference plane as seen by each camera pixel, and the conversion of coordinates to depths.

use super::{Constants, Given, Plane};
use glam::{DMat2, DVec2, DVec3};
use phasmid_core::error::{Error, Result};
use phasmid_decode::triangulate::WORST_RELATIVE_SIGMA;
use phasmid_geometry::Rig;
use phasmid_pattern::Axis;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Maximum RMS distance of the points of a captured reference from the plane fitted to them, as a
/// fraction of the plane's distance from the camera.
const WORST_PLANE: f64 = 0.01;

/// Measures of how well the formula's assumptions hold for a reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// RMS distance of the reference from its fitted plane, in mm; 0 for a computed reference.
    pub plane_rms_mm: f64,
    /// RMS difference, in projector pixels, between the coordinate and the best linear function of
    /// the position on the plane.
    pub linear_rms_px: f64,
    /// Distance of the projector's pupil from the plane minus the camera pupil's distance, in mm.
    pub farther_mm: f64,
}

/// Converts coordinates along one axis to depths by the phase-to-height formula.
#[derive(Debug, Clone)]
pub struct Mapping {
    /// The projector's axis along which coordinates are measured.
    pub axis: Axis,
    /// Period of the fringe in projector pixels.
    pub period_px: f64,
    /// L, D and f0.
    pub constants: Constants,
    /// The reference plane in the camera's frame; its distance is L.
    pub plane: Plane,
    /// Measures of how well the assumptions hold.
    pub quality: Quality,
    rays: Vec<DVec3>,
    /// Per camera pixel, the coordinate on the plane and its standard deviation; NaN if unknown.
    reference: Vec<[f64; 2]>,
}

impl Mapping {
    /// Computes the reference from the rig, for a plane perpendicular to the camera's axis at
    /// `z_mm`.
    ///
    /// # Errors
    /// Returns an error if camera and projector share no part of the plane, or if the coordinate
    /// does not change along the baseline.
    pub fn of_plane(rig: &Rig, axis: Axis, period_px: f64, z_mm: f64) -> Result<Self> {
        let plane = Plane::across(z_mm);
        let rays = rays(rig);
        let camera = &rig.camera.rig_from_view;
        let lens = &rig.projector.lens;
        let reference: Vec<[f64; 2]> = rays
            .par_iter()
            .map(|ray| {
                let p = camera.point(*ray * plane.depth_mm(*ray, 0.0));
                let px = rig.projector.project(p);
                px.map_or([f64::NAN; 2], |px| [px[axis as usize], 0.0])
            })
            .collect();
        let lit = |p: DVec3| {
            let px = rig.projector.project(camera.point(p));
            px.is_some_and(|px| lens.contains(px))
        };
        Self::new(rig, axis, period_px, (plane, 0.0), rays, reference, lit)
    }

    /// Creates the mapping from a captured reference plane. Coordinates along `axis` and their
    /// sigmas are in projector pixels, depths and their sigmas in mm. Each map is height x width in
    /// row-major order; missing values are NaN.
    ///
    /// # Errors
    /// Returns an error if the maps do not have the size of the camera's image, if the points are
    /// not planar, or if the coordinate does not change along the baseline.
    pub fn of_capture(
        rig: &Rig,
        axis: Axis,
        period_px: f64,
        coordinate: [&[f32]; 2],
        depth: [&[f32]; 2],
    ) -> Result<Self> {
        let rays = rays(rig);
        if [coordinate, depth]
            .concat()
            .iter()
            .any(|map| map.len() != rays.len())
        {
            let lens = &rig.camera.lens;
            return Err(Error::input(
                "reference",
                "images of another size",
                format!(
                    "{} x {}, as in the calibration",
                    lens.width_px, lens.height_px
                ),
            ));
        }
        let samples: Vec<_> = (0..rays.len())
            .map(|i| (rays[i], f64::from(depth[0][i]), f64::from(depth[1][i])))
            .collect();
        let (plane, rms) = Plane::fit(&samples)
            .filter(|(plane, rms)| *rms <= WORST_PLANE * plane.distance_mm)
            .ok_or_else(|| {
                Error::input(
                    "reference",
                    "no plane in its points",
                    format!(
                        "a capture of a bare plane, flat to {} % of its distance",
                        100.0 * WORST_PLANE
                    ),
                )
            })?;
        let reference = coordinate[0].iter().zip(coordinate[1]);
        let reference = reference
            .map(|(x, s)| [f64::from(*x), f64::from(*s)])
            .collect();
        Self::new(rig, axis, period_px, (plane, rms), rays, reference, |_| {
            true
        })
    }

    fn new(
        rig: &Rig,
        axis: Axis,
        period_px: f64,
        (plane, plane_rms_mm): (Plane, f64),
        rays: Vec<DVec3>,
        reference: Vec<[f64; 2]>,
        lit: impl Fn(DVec3) -> bool,
    ) -> Result<Self> {
        let points: Vec<(DVec3, f64)> = rays
            .iter()
            .zip(&reference)
            .map(|(ray, [x, _])| (*ray * plane.depth_mm(*ray, 0.0), *x))
            .filter(|(p, x)| x.is_finite() && p.z > 0.0 && p.is_finite() && lit(*p))
            .collect();
        let projector =
            (rig.camera.rig_from_view.inverse() * rig.projector.rig_from_view).translation_mm;
        let found = slope(&plane, &points).filter(|(slope, _)| slope.length() > 0.0);
        let (slope, linear_rms_px) = found.ok_or_else(|| {
            Error::input(
                "reference plane",
                format!("{} of its pixels lit by the projector", points.len()),
                "a plane that the camera sees and the projector lights",
            )
        })?;
        let constants = Constants {
            distance_mm: plane.distance_mm,
            baseline_mm: projector.dot(slope) / slope.length(),
            fringes_per_mm: slope.length() / period_px,
        };
        // The baseline must have a component along the direction in which the coordinate changes.
        if !(constants.baseline_mm.abs() > 1e-3 * projector.length()) {
            return Err(Error::input(
                format!("sequence, axis {axis}"),
                format!("a baseline of {:.3} mm along it", constants.baseline_mm),
                "the axis along which camera and projector are separated",
            ));
        }
        Ok(Self {
            axis,
            period_px,
            constants,
            plane,
            quality: Quality {
                plane_rms_mm,
                linear_rms_px,
                farther_mm: plane.height_mm(projector) - plane.distance_mm,
            },
            rays,
            reference,
        })
    }

    /// Replaces constants by measured ones. The plane moves along its normal to the given distance.
    #[must_use]
    pub fn with(mut self, given: &Given) -> Self {
        self.constants = self.constants.with(given);
        self.plane.distance_mm = self.constants.distance_mm;
        self
    }

    /// Returns the phase shift in radians of camera pixel `i` relative to the plane, for coordinate
    /// `px`. It is positive for surfaces nearer to the camera if the baseline is positive.
    pub fn dphi(&self, i: usize, px: f64) -> f64 {
        -TAU * (px - self.reference[i][0]) / self.period_px
    }

    /// Computes the depth z in the camera's frame and its standard deviation, both in mm, at camera
    /// pixel `i` for coordinate `px` with standard deviation `sigma` (projector pixels). Returns
    /// `None` if the pixel has no reference, if the depth is not positive, or if its relative
    /// standard deviation exceeds `WORST_RELATIVE_SIGMA`.
    pub fn depth_mm(&self, i: usize, px: f64, sigma: f64) -> Option<(f64, f64)> {
        let dphi = self.dphi(i, px);
        let ray = self.rays[i];
        let z = self.plane.depth_mm(ray, self.constants.height_mm(dphi));
        let dphi_sigma = TAU / self.period_px * sigma.hypot(self.reference[i][1]);
        let slope = self.constants.slope_mm(dphi) / self.plane.normal.dot(ray);
        let s = slope.abs() * dphi_sigma;
        // Each of these comparisons is false for NaN.
        (z > 0.0 && s <= WORST_RELATIVE_SIGMA * z && z.is_finite()).then_some((z, s))
    }

    /// Computes depths from coordinates. Depths and their standard deviations are in mm,
    /// coordinates and their standard deviations in projector pixels. Each map is height x width in
    /// row-major order; missing values are NaN. If lengths differ, elements past the end of the
    /// shortest map are left unchanged.
    pub fn depths(&self, [px, sigma]: [&[f32]; 2], depth: &mut [f32], depth_sigma: &mut [f32]) {
        let n = self.rays.len().min(px.len()).min(sigma.len());
        depth
            .par_iter_mut()
            .zip(depth_sigma)
            .take(n)
            .enumerate()
            .for_each(|(i, (depth, depth_sigma))| {
                let found = self.depth_mm(i, f64::from(px[i]), f64::from(sigma[i]));
                let (z, s) = found.unwrap_or((f64::NAN, f64::NAN));
                (*depth, *depth_sigma) = (z as f32, s as f32);
            });
    }
}

/// Rays of all camera pixels in row-major order, with z = 1 in the camera's frame.
fn rays(rig: &Rig) -> Vec<DVec3> {
    let lens = &rig.camera.lens;
    let width = lens.width_px;
    let pixels = (0..lens.height_px).into_par_iter().flat_map_iter(|v| {
        (0..width).map(move |u| lens.ray(DVec2::new(f64::from(u), f64::from(v))))
    });
    pixels.collect()
}

/// Fits a linear function of the position on the plane to coordinates. Returns its gradient, in
/// projector pixels per mm, and the RMS difference.
fn slope(plane: &Plane, points: &[(DVec3, f64)]) -> Option<(DVec3, f64)> {
    let (e1, e2) = plane.normal.any_orthonormal_pair();
    let n = points.len() as f64;
    let sum = points
        .iter()
        .fold((DVec3::ZERO, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    let middle = (sum.0 / n, sum.1 / n);
    let place = |p: DVec3| {
        let off = p - middle.0;
        DVec2::new(e1.dot(off), e2.dot(off))
    };
    let (mut xx, mut xy, mut yy, mut right) = (0.0, 0.0, 0.0, DVec2::ZERO);
    for (p, x) in points {
        let q = place(*p);
        (xx, xy, yy) = (xx + q.x * q.x, xy + q.x * q.y, yy + q.y * q.y);
        right += q * (x - middle.1);
    }
    let matrix = DMat2::from_cols_array(&[xx, xy, xy, yy]);
    if points.len() < 3 || !(matrix.determinant() > 1e-12 * (xx + yy).powi(2)) {
        return None;
    }
    let g = matrix.inverse() * right;
    let square: f64 = points
        .iter()
        .map(|(p, x)| (x - middle.1 - g.dot(place(*p))).powi(2))
        .sum();
    g.is_finite()
        .then(|| (e1 * g.x + e2 * g.y, (square / n).sqrt()))
}
