//! A camera's response: how the numbers in its frames follow from light.

use phasmid_core::check::Check;
use phasmid_core::error::Result;
use serde::{Deserialize, Serialize};

/// The curve from the converter's linear numbers to the numbers in the frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum CameraResponse {
    /// The linear numbers themselves.
    Linear {},
    /// DN = full (linear / full)^(1 / gamma), full the converter's largest number and the black
    /// level a part of what is bent: what industrial cameras call gamma (GenICam Standard Features
    /// Naming Convention 2.7, `Gamma`, whose value is our 1 / gamma). Its inverse is
    /// linear = full (DN / full)^gamma.
    Gamma {
        /// 2.2 for pictures that are to look right on a screen.
        gamma: f64,
    },
}

impl Default for CameraResponse {
    fn default() -> Self {
        Self::Linear {}
    }
}

impl CameraResponse {
    /// Whether the curve is any other than the straight line.
    #[inline]
    pub fn is_bent(&self) -> bool {
        !matches!(self, Self::Linear {} | Self::Gamma { gamma: 1.0 })
    }

    /// The number in the frame, not rounded, of a linear one in 0 to `full_scale`.
    #[inline]
    pub fn apply(&self, linear_dn: f64, full_scale: f64) -> f64 {
        match self {
            Self::Linear {} => linear_dn,
            Self::Gamma { gamma } => full_scale * (linear_dn / full_scale).powf(1.0 / gamma),
        }
    }

    /// The linear number, not rounded, of one in the frame: the inverse of [`Self::apply`].
    pub fn invert(&self, dn: f64, full_scale: f64) -> f64 {
        match self {
            Self::Linear {} => dn,
            Self::Gamma { gamma } => full_scale * (dn / full_scale).powf(*gamma),
        }
    }

    /// The line (slope, value at the dark end) that fits the variance of the frame's numbers best
    /// over those numbers, given the `variance` of linear ones between two ends.
    pub(super) fn line(
        &self,
        variance: impl Fn(f64) -> f64,
        ends: [f64; 2],
        full_scale: f64,
    ) -> (f64, f64) {
        let [dark, light] = ends.map(|dn| self.apply(dn, full_scale));
        let samples = (0..64).map(|k| {
            let dn = dark + (light - dark) * (f64::from(k) + 0.5) / 64.0;
            let linear = self.invert(dn, full_scale);
            // The slope of the curve there, over one number.
            let (low, high) = ((dn - 0.5).max(0.0), (dn + 0.5).min(full_scale));
            let span = self.invert(high, full_scale) - self.invert(low, full_scale);
            let slope = (high - low) / span;
            (dn - dark, slope.powi(2) * variance(linear))
        });
        let (mut x, mut y, mut xx, mut xy) = (0.0, 0.0, 0.0, 0.0);
        for (dn, v) in samples {
            x += dn / 64.0;
            y += v / 64.0;
            xx += dn * dn / 64.0;
            xy += dn * v / 64.0;
        }
        let spread = xx - x * x;
        let slope = if spread > 0.0 {
            (xy - x * y) / spread
        } else {
            0.0
        };
        // Neither may be negative: then the other alone fits.
        let slope = slope.clamp(0.0, if x > 0.0 { y / x } else { 0.0 });
        (slope, y - slope * x)
    }
}

pub(super) fn check(response: CameraResponse, check: &Check<'_>) -> Result<()> {
    match response {
        CameraResponse::Linear {} => Ok(()),
        CameraResponse::Gamma { gamma } => {
            check.within("camera.sensor.response.gamma", gamma, 0.25..=4.0)
        }
    }
}
