//! Rays of the camera: their directions, and bundles of sixteen rays to cast.

use crate::exposure::Optics;
use glam::{DMat2, DVec2, DVec3};
use phasmid_geometry::raycast::LANES;
use rayon::prelude::*;

/// Directions of the camera's rays: computed, or looked up if the lens has distortion.
pub(crate) struct Rays<'a> {
    pub(crate) optics: &'a Optics,
    /// Ideal (undistorted) image points of all pixels, if the lens has distortion.
    pub(crate) table: Option<&'a [DVec2]>,
    pub(crate) width: usize,
}

impl Rays<'_> {
    /// Returns the direction, with z = 1, through a pixel's centre.
    pub(crate) fn center(&self, column: usize, row: usize) -> DVec3 {
        match self.table {
            Some(table) => table[row * self.width + column].extend(1.0),
            None => self.through(DVec2::new(column as f64, row as f64)),
        }
    }

    /// Returns the derivatives of a direction, with z = 1, with respect to the position in the image
    /// in pixels.
    pub(crate) fn slope(&self, direction: DVec3) -> DMat2 {
        let lens = &self.optics.camera.lens;
        let scale = DMat2::from_diagonal(1.0 / lens.focal_px);
        match self.table {
            Some(_) => lens.distort_jacobian(direction.truncate()).inverse() * scale,
            None => scale,
        }
    }

    /// Returns the direction, with z = 1, through any image point.
    pub(crate) fn through(&self, px: DVec2) -> DVec3 {
        self.optics.camera.lens.ray(px)
    }
}

pub(crate) fn ideal_points(optics: &Optics) -> Vec<DVec2> {
    let lens = optics.camera.lens;
    (0..lens.height_px)
        .into_par_iter()
        .flat_map_iter(|v| {
            (0..lens.width_px)
                .map(move |u| lens.ray(DVec2::new(f64::from(u), f64::from(v))).truncate())
        })
        .collect()
}

/// Sixteen camera rays to cast.
pub(crate) struct Bundle {
    /// Origin: a point of the camera's pupil.
    pub(crate) origin: DVec3,
    /// Directions, with z = 1.
    pub(crate) directions: [DVec3; LANES],
    pub(crate) used: [bool; LANES],
    /// Side in pixels of the square that each ray represents.
    pub(crate) cell: f64,
}
