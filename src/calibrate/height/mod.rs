//! Phase-to-height conversion against a reference plane after Wu et al., kept beside triangulation
//! for comparison with their paper:
//!
//! ```text
//! h = L dphi / (2 pi f0 D + dphi)
//! ```
//!
//! h is the height above the plane towards the camera, L the camera's distance from the plane, D
//! the baseline, f0 the number of fringes per mm on the plane, and dphi the phase shift of a camera
//! pixel relative to the bare plane. The formula follows from two similar triangles: a camera ray
//! that meets the surface at height h sees a fringe that, without the surface, would fall on the
//! plane h D / (L - h) away from the point where the ray would meet the plane.
//!
//! The formula is exact if both pupils are equally far from the plane and the projected coordinate
//! is linear on it, that is, if the projector's image plane is parallel to the reference plane and
//! its lens has no distortion. The camera may have any orientation and distortion, because each
//! pixel has its own reference. `pmp-bench` is such a rig. For other rigs heights have a relative
//! error. To first order it is e + e x / D at x mm beside the camera if the projector is farther
//! from the plane than the camera by a fraction e, and 2 a x / L at x mm beside the projector if
//! the projector is rotated by an angle a about the direction of the fringes. Triangulation has no
//! such limit.
//!
//! # Signs
//!
//! D is the component of the vector from the camera's pupil to the projector's along the direction
//! on the plane in which the coordinate grows, with its sign, and dphi = -2 pi (x - x_plane) /
//! period: a surface nearer than the plane shifts the coordinate against that component. So h is
//! positive towards the camera whichever side the projector is on and however its image is
//! oriented. The period cancels; it only makes f0 the number of fringes that can be counted on the
//! plane.
//!
//! # Files
//!
//! This file has the constants L, D, f0 and the formula.
//!
//! - `plane`: the reference plane and its fit
//! - `reference`: the reference of each camera pixel, and the conversion of coordinates to depths

mod plane;
mod reference;

#[cfg(test)]
mod tests;

pub use plane::Plane;
pub use reference::{Mapping, Quality};

use std::f64::consts::TAU;

/// The constants L, D and f0 of `h = L dphi / (2 pi f0 D + dphi)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constants {
    /// L: distance of the camera's pupil from the reference plane, in mm.
    pub distance_mm: f64,
    /// D: component of the vector from the camera's pupil to the projector's, in mm, along the
    /// direction on the plane in which the coordinate grows. Negative if the projector is on the
    /// opposite side.
    pub baseline_mm: f64,
    /// f0: fringes per mm on the plane, along the same direction.
    pub fringes_per_mm: f64,
}

/// Measured constants, which replace constants computed from the calibration.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Given {
    /// L in mm.
    pub distance_mm: Option<f64>,
    /// Magnitude of D in mm; the sign is taken from the calibration.
    pub baseline_mm: Option<f64>,
    /// f0 in fringes per mm.
    pub fringes_per_mm: Option<f64>,
}

impl Constants {
    /// Returns the height above the plane in mm for a phase shift of `dphi` radians.
    pub fn height_mm(&self, dphi: f64) -> f64 {
        self.distance_mm * dphi / (self.stride() + dphi)
    }

    /// Returns the derivative of [`Self::height_mm`], in mm per radian.
    pub fn slope_mm(&self, dphi: f64) -> f64 {
        let stride = self.stride();
        self.distance_mm * stride / ((stride + dphi) * (stride + dphi))
    }

    /// Returns these constants, with each one that `given` contains replaced.
    #[must_use]
    pub fn with(&self, given: &Given) -> Self {
        Self {
            distance_mm: given.distance_mm.unwrap_or(self.distance_mm),
            baseline_mm: given
                .baseline_mm
                .map_or(self.baseline_mm, |d| d.copysign(self.baseline_mm)),
            fringes_per_mm: given.fringes_per_mm.unwrap_or(self.fringes_per_mm),
        }
    }

    /// 2 pi f0 D in radians. A point at infinity behind the plane has this phase shift with the
    /// opposite sign.
    fn stride(&self) -> f64 {
        TAU * self.fringes_per_mm * self.baseline_mm
    }
}
