//! The tumour's shape: star-shaped around its centre, with a radius that is a sum of real spherical
//! harmonics of degrees 2 to 5 with random coefficients. Its volume is exactly that of a
//! ball with the diameter that the patient's parameters give.

mod sphere;
#[cfg(test)]
mod tests;

use super::organs::Organs;
use super::parameters::{Lobe, Patient};
use super::random::Draws;
use glam::DVec3;
use phasmid_core::statistics::gauss_legendre;
use phasmid_geometry::Mesh;
use sphere::{RADIAL, directions, harmonics, icosphere};
use std::f64::consts::PI;

/// Degrees of the harmonics.
const DEGREES: std::ops::RangeInclusive<usize> = 2..=5;
/// Share of each degree in the roughness.
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
                // By the addition theorem, sum_m Y_lm^2 is (2l + 1) / 4 pi everywhere, so by the
                // Cauchy-Schwarz inequality the degree's sum stays within roughness * share.
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

    /// Returns the point from which radii are measured.
    pub(super) fn centre(&self) -> DVec3 {
        self.centre
    }

    /// Returns the distance from the centre to the surface in a unit direction, in millimetres.
    pub(super) fn radius(&self, direction: DVec3) -> f64 {
        let sum: f64 = (DEGREES.zip(&self.coefficients))
            .map(|(l, c)| {
                let values = harmonics(l, direction);
                c.iter().zip(values).map(|(c, y)| c * y).sum::<f64>()
            })
            .sum();
        self.radius_mm * (1.0 + sum)
    }

    /// Returns the volume at the reference phase, in cubic millimetres.
    pub(super) fn volume_mm3(&self) -> f64 {
        let thirds = |(n, w)| w * self.radius(n).powi(3) / 3.0;
        directions().map(thirds).sum()
    }

    /// Returns the centroid at the reference phase.
    pub(super) fn centroid(&self) -> DVec3 {
        let moment: DVec3 = directions()
            .map(|(n, w)| n * (w * self.radius(n).powi(4) / 4.0))
            .sum();
        self.centre + moment / self.volume_mm3()
    }

    /// Returns points of the surface.
    pub(super) fn surface(&self) -> impl Iterator<Item = DVec3> + '_ {
        directions().map(|(n, _)| self.centre + n * self.radius(n))
    }

    /// Returns quadrature points inside, each with its volume in cubic millimetres.
    pub(super) fn inside(&self) -> impl Iterator<Item = (DVec3, f64)> + '_ {
        let radial = gauss_legendre(RADIAL);
        directions().flat_map(move |(n, w)| {
            let radius = self.radius(n);
            radial.clone().into_iter().map(move |(u, v)| {
                let r = radius * 0.5 * (u + 1.0);
                (self.centre + n * r, w * v * 0.5 * radius * r * r)
            })
        })
    }

    /// Distance from the centre minus the surface's radius in that direction; negative inside.
    pub(super) fn outside(&self, x: DVec3) -> f64 {
        let off = x - self.centre;
        let length = off.length();
        if length > 2.0 * self.radius_mm {
            return length - 1.35 * self.radius_mm;
        }
        length - self.radius(if length > 0.0 { off / length } else { DVec3::Z })
    }

    /// Describes how the tumour lies outside its lobe or the lungs; `None` if it does not.
    pub(super) fn out_of_lobe(&self, lobe: Lobe, organs: &Organs) -> Option<String> {
        let found = organs.lobe(self.centre());
        if found != Some(lobe) {
            return Some(match found {
                Some(other) => format!("a tumour centred in another lobe ({other:?})"),
                None => "a tumour centred outside the lungs".to_owned(),
            });
        }
        let out = (self.surface().map(|x| organs.lungs(x))).fold(f64::MIN, f64::max);
        (out > 0.0).then(|| format!("a tumour that extends {out:.1} mm out of the lung"))
    }

    /// Returns the surface as a closed mesh of 20 * 4^level outward triangles.
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
