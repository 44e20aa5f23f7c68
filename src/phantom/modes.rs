//! The displacement fields (modes) that make up all motion: u(x) = sum over k of w_k m_k(x), in the
//! body frame.
//!
//! Weights are in millimetres of the motion for which the mode is named. Three modes move the skin.
//! The other two only move the inside of the cavity of ribs and abdominal wall and fade smoothly to
//! zero at its wall, so that lungs slide along the ribs within some 50 mm instead of along a slit.
//! All modes, and all combinations of them, are twice continuously differentiable.

use super::organs::Organs;
use super::outline::STATURE_MM;
use super::parameters::Patient;
use super::real::{Jet, Real};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Number of modes. The first three move the skin.
pub const MODES: usize = 5;
/// Forward motion of the breastbone (pump handle) with sideways motion of the lower ribs (bucket
/// handle).
pub const THORAX: usize = 0;
/// Forward motion of the abdominal wall.
pub const ABDOMEN: usize = 1;
/// Abdomen in, chest up: coughs and posture.
pub const POSTURE: usize = 2;
/// Motion of the diaphragm towards the feet, with the lungs above and the organs below it.
pub const DIAPHRAGM: usize = 3;
/// Motion of the lungs themselves to the front and the sides.
pub const LUNG: usize = 4;

/// Part of the cavity, measured by [`Organs::cavity`], that moves rigidly with the inner modes.
const WHOLE: f64 = 0.1;

/// The modes of one patient.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Modes {
    organs: Organs,
    scale: f64,
    stature_mm: f64,
}

impl Modes {
    pub(super) fn new(p: &Patient) -> Self {
        Self {
            organs: Organs::new(p),
            scale: p.stature_mm / STATURE_MM,
            stature_mm: p.stature_mm,
        }
    }

    /// Displacement of each mode per unit weight.
    fn fields<T: Real>(&self, [x, y, z]: [T; 3]) -> [[T; 3]; MODES] {
        let (s, none) = (self.scale, x.constant(0.0));
        let h = z * (1.0 / self.stature_mm);
        // Smooth step from 0 to 1 between two heights relative to stature.
        let from_to = |none: f64, all: f64| ((h - none) * (1.0 / (all - none))).rise();
        // The front moves; the spine and back do not.
        let front = ((y - 70.0 * s) * (-1.0 / (175.0 * s))).rise();
        let aside =
            (x * (1.0 / (60.0 * s))).saturated() * ((y - 90.0 * s) * (-1.0 / (120.0 * s))).rise();

        let breastbone = front * from_to(0.15, 0.05) * from_to(-0.07, 0.01);
        let lower_ribs = aside * from_to(0.10, 0.02) * from_to(-0.08, 0.0);
        let wall = from_to(0.04, -0.05) * from_to(-0.19, -0.07);
        let belly = front * wall;

        // Returns 1 inside the cavity, fading to 0 at its wall.
        let out = (self.organs.cavity([x, y, z]) - WHOLE) * (1.0 / (1.0 - WHOLE));
        let inside = -out.rise() + 1.0;
        let pushed = inside * from_to(0.13, 0.0) * from_to(-0.19, -0.04);
        let lungs = inside * from_to(0.13, 0.03) * from_to(-0.10, 0.0);
        [
            [lower_ribs * 0.25, -breastbone, breastbone * 0.3],
            [aside * wall * 0.2, -belly, none],
            [none, belly * 0.8 - breastbone * 0.5, breastbone * 0.4],
            [none, none, -pushed],
            [
                lungs * (x * (1.0 / (60.0 * s))).saturated() * 0.3,
                -lungs,
                none,
            ],
        ]
    }

    /// Returns the displacement of each mode at a point, per millimetre of weight.
    pub(super) fn units(&self, x: DVec3) -> [DVec3; MODES] {
        self.fields(x.to_array()).map(DVec3::from_array)
    }

    /// Returns the displacement for given weights, in millimetres.
    pub(super) fn displacement(&self, x: DVec3, weights: &[f64; MODES]) -> DVec3 {
        let units = self.units(x);
        (0..MODES).map(|k| units[k] * weights[k]).sum()
    }

    /// Returns the gradients of the modes, per millimetre of weight; column j is the derivative by
    /// coordinate j.
    fn gradients(&self, x: DVec3) -> [DMat3; MODES] {
        self.fields(Jet::place(x)).map(|field| {
            DMat3::from_cols_array_2d(&field.map(|c| c.gradient.to_array())).transpose()
        })
    }

    /// Returns the gradient of the displacement for given weights.
    pub(super) fn gradient(&self, x: DVec3, weights: &[f64; MODES]) -> DMat3 {
        let gradients = self.gradients(x);
        (0..MODES).fold(DMat3::ZERO, |sum, k| sum + gradients[k] * weights[k])
    }

    /// Returns the smallest determinant of I + grad u, the local volume ratio, over a lattice of
    /// the body and all corners of the weights' bounds.
    pub(super) fn least_determinant(&self, bounds: &[[f64; 2]; MODES]) -> f64 {
        const ACROSS: i32 = 9;
        const DEEP: i32 = 7;
        const ALONG: i32 = 34;
        let step = 22.0 * self.scale;
        let most = bounds.map(|[a, b]| a.abs().max(b.abs()));
        (0..ALONG)
            .into_par_iter()
            .map(|i| {
                let h = -0.2 + 0.36 * f64::from(i) / f64::from(ALONG - 1);
                let mut least = 1.0f64;
                for j in -ACROSS..=ACROSS {
                    for k in -DEEP..=DEEP {
                        let place = DVec3::new(f64::from(j) * step, f64::from(k) * step, 0.0);
                        let x = place + DVec3::Z * h * self.stature_mm;
                        let gradients = self.gradients(x);
                        // The determinant is at least (1 - |grad u|)^3.
                        let norm: f64 = (0..MODES).map(|k| most[k] * norm(&gradients[k])).sum();
                        if (1.0 - norm).max(0.0).powi(3) < least {
                            least = least.min(corners(&gradients, bounds));
                        }
                    }
                }
                least
            })
            .reduce(|| 1.0, f64::min)
    }

    /// Returns the organs on which the modes are based.
    pub(super) fn organs(&self) -> &Organs {
        &self.organs
    }

    /// Returns the point that the displacement maps to `y`, by Newton's method with step halving.
    /// If the determinant of I + grad u is positive everywhere (no folds), exactly one such point
    /// exists, and the result maps to within 1e-9 mm of `y`.
    pub(super) fn inverse(&self, y: DVec3, weights: &[f64; MODES]) -> DVec3 {
        let miss = |x: DVec3| x + self.displacement(x, weights) - y;
        let mut x = y - self.displacement(y, weights);
        let mut off = miss(x);
        for _ in 0..60 {
            if off.length() < 1e-11 {
                break;
            }
            let step = (DMat3::IDENTITY + self.gradient(x, weights)).inverse() * off;
            let mut share = 1.0;
            loop {
                let next = x - step * share;
                let next_off = miss(next);
                if next_off.length() < off.length() || share < 1e-3 {
                    (x, off) = (next, next_off);
                    break;
                }
                share *= 0.5;
            }
            if share < 1e-3 {
                // Rounding prevents further improvement.
                break;
            }
        }
        x
    }
}

/// Frobenius norm, an upper bound of the stretch.
fn norm(m: &DMat3) -> f64 {
    m.to_cols_array().iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Smallest determinant over the corners of the weights' box.
fn corners(gradients: &[DMat3; MODES], bounds: &[[f64; 2]; MODES]) -> f64 {
    (0..1usize << MODES)
        .map(|corner| {
            let weight = |k: usize| bounds[k][corner >> k & 1];
            (0..MODES)
                .fold(DMat3::IDENTITY, |sum, k| sum + gradients[k] * weight(k))
                .determinant()
        })
        .fold(f64::MAX, f64::min)
}
