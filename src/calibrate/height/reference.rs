//! A reference plane as each camera pixel sees it, and the mapping from a coordinate to a depth.

use super::{Constants, Given, Plane};
use glam::{DMat2, DVec2, DVec3};
use phasmid_core::error::{Error, Result};
use phasmid_decode::triangulate::WORST_RELATIVE_SIGMA;
use phasmid_geometry::Rig;
use phasmid_pattern::Axis;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// A reference whose pixels are off a plane by more than this part of its distance is none.
const WORST_PLANE: f64 = 0.01;

/// How well the formula's assumptions hold on a reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Root of the mean squared distance of the reference from its plane, in mm; 0 where computed.
    pub plane_rms_mm: f64,
    /// Root of the mean squared difference, in projector pixels, between the coordinate and the
    /// linear function of the place on the plane nearest to it.
    pub linear_rms_px: f64,
    /// How much farther the projector's pupil is from the plane than the camera's, in mm.
    pub farther_mm: f64,
}

/// Coordinates of one axis to depths by the phase-to-height formula.
#[derive(Debug, Clone)]
pub struct Mapping {
    /// The axis whose coordinate is mapped.
    pub axis: Axis,
    /// Period of the fringe in projector pixels.
    pub period_px: f64,
    /// L, D and f0.
    pub constants: Constants,
    /// The reference plane in the camera's frame; its distance is L.
    pub plane: Plane,
    /// How well the assumptions hold.
    pub quality: Quality,
    rays: Vec<DVec3>,
    /// Coordinate on the plane and its standard deviation per pixel, NaN where there is none.
    reference: Vec<[f64; 2]>,
}

/// The distance in mm along the camera's axis at which the middles of the two images meet: where the
/// rays through them come nearest. `None` where they do not in front of both.
pub fn meeting_mm(rig: &Rig) -> Option<f64> {
    let middle = |lens: &phasmid_geometry::Lens| {
        (DVec2::new(f64::from(lens.width_px), f64::from(lens.height_px)) - 1.0) * 0.5
    };
    let a = rig.camera.lens.ray(middle(&rig.camera.lens));
    let camera_from_rig = rig.camera.rig_from_view.inverse();
    let b = camera_from_rig.direction(rig.projector.ray(middle(&rig.projector.lens)));
    let between = camera_from_rig.point(rig.projector.center());
    // s a and between + t b are nearest where their difference is across both.
    let across = a.cross(b);
    let s = between.cross(b).dot(across) / across.length_squared();
    let t = between.cross(a).dot(across) / across.length_squared();
    (s > 0.0 && t > 0.0 && s.is_finite()).then_some(s)
}

impl Mapping {
    /// The mapping against a plane across the camera's axis at `z_mm`, computed from the rig.
    ///
    /// # Errors
    /// A plane that camera and projector do not share, or one on which the coordinate does not
    /// change along the baseline.
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

    /// The mapping against a plane that was captured: its coordinates along `axis` and their standard
    /// deviations in projector pixels, and its depths and theirs in mm, each height x width row by
    /// row, NaN where there is none.
    ///
    /// # Errors
    /// Maps of another size than the rig's camera has, what is no plane, or one on which the
    /// coordinate does not change along the baseline.
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
                "pictures of another size",
                format!(
                    "{} x {} as the calibration says",
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
                format!("{} pixels of it that the projector lights", points.len()),
                "a plane that camera and projector share",
            )
        })?;
        let constants = Constants {
            distance_mm: plane.distance_mm,
            baseline_mm: projector.dot(slope) / slope.length(),
            fringes_per_mm: slope.length() / period_px,
        };
        // Of the baseline, next to nothing along the way in which the coordinate changes.
        if !(constants.baseline_mm.abs() > 1e-3 * projector.length()) {
            return Err(Error::input(
                format!("sequence, axis {axis}"),
                format!("a baseline of {:.3} mm along it", constants.baseline_mm),
                "the axis along which camera and projector stand apart",
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

    /// The mapping with constants that somebody has measured in place of its own. The plane moves
    /// along its normal to the distance that is given.
    #[must_use]
    pub fn with(mut self, given: &Given) -> Self {
        self.constants = self.constants.with(given);
        self.plane.distance_mm = self.constants.distance_mm;
        self
    }

    /// How far, in radians, the phase at camera pixel `i` has moved from the plane's where the
    /// coordinate is `px`, positive towards the camera with a positive baseline.
    pub fn dphi(&self, i: usize, px: f64) -> f64 {
        -TAU * (px - self.reference[i][0]) / self.period_px
    }

    /// Depth z in the camera's frame and its standard deviation, both in mm, at camera pixel `i` with
    /// coordinate `px` of standard deviation `sigma` in projector pixels. `None` where the plane has
    /// no reference, behind the camera, or where noise leaves nothing of it.
    pub fn depth_mm(&self, i: usize, px: f64, sigma: f64) -> Option<(f64, f64)> {
        let dphi = self.dphi(i, px);
        let ray = self.rays[i];
        let z = self.plane.depth_mm(ray, self.constants.height_mm(dphi));
        let dphi_sigma = TAU / self.period_px * sigma.hypot(self.reference[i][1]);
        let slope = self.constants.slope_mm(dphi) / self.plane.normal.dot(ray);
        let s = slope.abs() * dphi_sigma;
        // NaN fails each of these.
        (z > 0.0 && s <= WORST_RELATIVE_SIGMA * z && z.is_finite()).then_some((z, s))
    }

    /// Depths and their standard deviations in mm from coordinates and theirs in projector pixels,
    /// each height x width row by row: NaN where there is none. Maps of another length are left as
    /// they are past the end of the shortest.
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

/// The camera's rays, row by row, with z = 1 in its frame.
fn rays(rig: &Rig) -> Vec<DVec3> {
    let lens = &rig.camera.lens;
    let width = lens.width_px;
    let pixels = (0..lens.height_px).into_par_iter().flat_map_iter(|v| {
        (0..width).map(move |u| lens.ray(DVec2::new(f64::from(u), f64::from(v))))
    });
    pixels.collect()
}

/// The slope on the plane of the linear function nearest to coordinates at points, in projector
/// pixels per mm, and the root of the mean squared difference.
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
