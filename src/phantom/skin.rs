//! The skin: a closed surface that is star-shaped around the body's axis at every height.

use super::outline::Outline;
use super::parameters::Patient;
use super::relief::Relief;
use glam::DVec3;

/// The skin of one patient at the reference phase, in the body frame.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Skin {
    outline: Outline,
    relief: Relief,
}

impl Skin {
    pub(super) fn new(p: &Patient) -> Self {
        let outline = Outline::new(p);
        Self {
            relief: Relief::new(p, &outline),
            outline,
        }
    }

    /// Returns the distance from the axis to the skin at an angle from x towards y, in millimetres;
    /// 0 at and beyond both ends.
    pub(super) fn radius(&self, angle: f64, z: f64) -> f64 {
        let cap = self.outline.cap(z);
        if cap <= 0.0 {
            return 0.0;
        }
        let (sin, cos) = angle.sin_cos();
        // The middle of the front is at -y; angles count from there to the left.
        let from_front = cos.atan2(-sin);
        cap * (self.outline.radius(sin, cos, z) + self.relief.at(from_front, z))
    }

    /// Returns the point of the skin at an angle and a height.
    pub(super) fn point(&self, angle: f64, z: f64) -> DVec3 {
        let (sin, cos) = angle.sin_cos();
        let radius = self.radius(angle, z);
        DVec3::new(radius * cos, radius * sin, z)
    }

    /// Returns the heights of the lower and the upper end.
    pub(super) fn ends(&self) -> [f64; 2] {
        self.outline.ends()
    }

    /// Signed distance from the skin, negative inside: exactly 0 on it, and accurate to a few per
    /// cent within some millimetres of it.
    pub(super) fn outside(&self, x: DVec3) -> f64 {
        let [lower, upper] = self.ends();
        let beyond = (lower - x.z).max(x.z - upper);
        let across = x.x.hypot(x.y);
        if beyond >= 0.0 {
            return beyond.hypot(across);
        }
        let angle = x.y.atan2(x.x);
        let radius = self.radius(angle, x.z);
        let off = across - radius;
        if off.abs() > 40.0 && self.outline.cap(x.z) == 1.0 {
            return off;
        }
        // The result is divided by the length of the gradient of `across - radius`.
        let step = 0.05f64.min(-0.5 * beyond);
        let along =
            (self.radius(angle, x.z + step) - self.radius(angle, x.z - step)) / (2.0 * step);
        let turn = step / radius.max(1.0);
        let around = (self.radius(angle + turn, x.z) - self.radius(angle - turn, x.z))
            / (2.0 * turn * radius.max(1.0));
        off / (1.0 + along * along + around * around).sqrt()
    }

    /// Distance from bone and muscle along the radius, positive outside.
    pub(super) fn outside_core(&self, x: DVec3) -> f64 {
        let across = x.x.hypot(x.y);
        let (sin, cos) = match across > 0.0 {
            true => (x.y / across, x.x / across),
            false => (0.0, 1.0),
        };
        across - self.outline.cap(x.z) * self.outline.core_radius(sin, cos, x.z)
    }

    /// Returns the scale of the layer over bone and muscle, in millimetres.
    #[cfg(test)]
    pub(super) fn layer_mm(&self) -> f64 {
        self.outline.layer_mm
    }
}
