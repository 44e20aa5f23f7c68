//! The three numbers of the formula.

use std::f64::consts::TAU;

/// L, D and f0 of `h = L dphi / (2 pi f0 D + dphi)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constants {
    /// L: distance of the camera's pupil from the reference plane, in mm.
    pub distance_mm: f64,
    /// D: the projector's pupil beside the camera's, in mm, along the direction on the plane in which
    /// the coordinate grows; negative where it stands on the other side.
    pub baseline_mm: f64,
    /// f0: fringes per mm on the plane, along that direction.
    pub fringes_per_mm: f64,
}

/// Constants that somebody has measured, in place of those of the calibration.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Given {
    /// L in mm.
    pub distance_mm: Option<f64>,
    /// The size of D in mm; its sign stays the calibration's.
    pub baseline_mm: Option<f64>,
    /// f0 in fringes per mm.
    pub fringes_per_mm: Option<f64>,
}

impl Constants {
    /// The height in mm over the plane where the phase has moved by `dphi` radians.
    pub fn height_mm(&self, dphi: f64) -> f64 {
        self.distance_mm * dphi / (self.stride() + dphi)
    }

    /// The derivative of [`Self::height_mm`], in mm per radian.
    pub fn slope_mm(&self, dphi: f64) -> f64 {
        let stride = self.stride();
        self.distance_mm * stride / ((stride + dphi) * (stride + dphi))
    }

    /// These with what is given in their place.
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

    /// The phase by which a point at infinity behind the plane would have moved, negated.
    fn stride(&self) -> f64 {
        TAU * self.fringes_per_mm * self.baseline_mm
    }
}
