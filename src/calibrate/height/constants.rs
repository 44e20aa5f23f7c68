//! The three constants of the phase-to-height formula.

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

    /// Returns the constants with the given ones replaced.
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

    /// 2 pi f0 D in radians: the negated phase shift of a point at infinity behind the plane.
    fn stride(&self) -> f64 {
        TAU * self.fringes_per_mm * self.baseline_mm
    }
}
