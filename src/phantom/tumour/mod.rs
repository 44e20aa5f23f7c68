//! The tumour's shape: star-shaped about its middle, its radius a sum of real spherical harmonics of
//! degrees 2 to 5 with random coefficients. Its volume is that of the ball of its diameter exactly.

mod icosphere;
mod sphere;
#[cfg(test)]
mod tests;

use super::organs::Organs;
use super::parameters::Patient;
use super::random::Draws;
use glam::DVec3;
use icosphere::icosphere;
use phasmid_geometry::Mesh;
use sphere::{RADIAL, directions, gauss, harmonics};
use std::f64::consts::PI;

/// Degrees of the harmonics, and how much of the roughness each has.
const DEGREES: std::ops::RangeInclusive<usize> = 2..=5;
const SHARES: [f64; 4] = [0.4, 0.3, 0.18, 0.12];
const STREAM: u32 = 2;

/// A tumour at the reference phase, in the body frame.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Shape {
    centre: DVec3,
    radius_mm: f64,
    /// Coefficients of each degree, by order -l to l.
    coefficients: Vec<Vec<f64>>,
}

impl Shape {
    pub(super) fn new(p: &Patient) -> Self {
        let draws = Draws::new(p.seed, STREAM);
        let mut index = 0;
        let coefficients = DEGREES
            .zip(SHARES)
            .map(|(l, share)| {
                let drawn: Vec<f64> = (0..=2 * l)
                    .map(|_| {
                        index += 1;
                        draws.even(index)
                    })
                    .collect();
                // By the addition theorem sum_m Y_lm^2 is (2l + 1) / 4 pi everywhere, so that by
                // Cauchy and Schwarz the degree's sum stays within roughness * share.
                let length = drawn.iter().map(|c| c * c).sum::<f64>().sqrt();
                let most = ((2 * l + 1) as f64 / (4.0 * PI)).sqrt();
                let scale = p.tumour.roughness * share / (length * most);
                drawn.iter().map(|c| c * scale).collect()
            })
            .collect();
        let organs = Organs::new(p);
        let mut shape = Self {
            centre: organs.place(p.tumour.lobe) + DVec3::from_array(p.tumour.offset_mm),
            radius_mm: 1.0,
            coefficients,
        };
        let ball = PI / 6.0 * p.tumour.diameter_mm.powi(3);
        shape.radius_mm = (ball / shape.volume_mm3()).cbrt();
        shape
    }

    /// The point that radii are measured from.
    pub(super) fn centre(&self) -> DVec3 {
        self.centre
    }

    /// Distance from the middle to the surface in a direction of length 1, in millimetres.
    pub(super) fn radius(&self, direction: DVec3) -> f64 {
        let sum: f64 = (DEGREES.zip(&self.coefficients))
            .map(|(l, c)| {
                let values = harmonics(l, direction);
                c.iter().zip(values).map(|(c, y)| c * y).sum::<f64>()
            })
            .sum();
        self.radius_mm * (1.0 + sum)
    }

    /// Volume at the reference phase, in cubic millimetres.
    pub(super) fn volume_mm3(&self) -> f64 {
        let thirds = |(n, w)| w * self.radius(n).powi(3) / 3.0;
        directions().map(thirds).sum()
    }

    /// Centroid at the reference phase.
    pub(super) fn centroid(&self) -> DVec3 {
        let moment: DVec3 = directions()
            .map(|(n, w)| n * (w * self.radius(n).powi(4) / 4.0))
            .sum();
        self.centre + moment / self.volume_mm3()
    }

    /// Points of the surface.
    pub(super) fn surface(&self) -> impl Iterator<Item = DVec3> + '_ {
        directions().map(|(n, _)| self.centre + n * self.radius(n))
    }

    /// Places inside with the volume that each stands for, in cubic millimetres.
    pub(super) fn inside(&self) -> impl Iterator<Item = (DVec3, f64)> + '_ {
        let radial = gauss(RADIAL);
        directions().flat_map(move |(n, w)| {
            let radius = self.radius(n);
            radial.clone().into_iter().map(move |(u, v)| {
                let r = radius * 0.5 * (u + 1.0);
                (self.centre + n * r, w * v * 0.5 * radius * r * r)
            })
        })
    }

    /// Whether a place is inside, by its distance from the middle less the surface's that way.
    pub(super) fn outside(&self, x: DVec3) -> f64 {
        let off = x - self.centre;
        let length = off.length();
        if length > 2.0 * self.radius_mm {
            return length - 1.35 * self.radius_mm;
        }
        length - self.radius(if length > 0.0 { off / length } else { DVec3::Z })
    }

    /// The surface as a closed mesh with outward triangles, 20 * 4^level of them.
    pub(super) fn mesh(&self, level: u32) -> Mesh {
        let (directions, triangles) = icosphere(level);
        Mesh {
            vertices: (directions.iter())
                .map(|&n| self.centre + n * self.radius(n))
                .collect(),
            triangles,
            ..Mesh::default()
        }
    }
}
