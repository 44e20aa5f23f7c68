//! Camera response: the curve from linear digital numbers to those stored in the frame.

use phasmid_core::check::Check;
use phasmid_core::error::Result;
use serde::{Deserialize, Serialize};

/// Response curve from the converter's linear digital numbers (DN) to the DN in the frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum CameraResponse {
    /// No change: frames contain the linear DN.
    Linear {},
    /// DN = full (linear / full)^(1 / gamma), where `full` is the converter's full scale; the curve
    /// applies to the black level too. Industrial cameras call this gamma (GenICam Standard
    /// Features Naming Convention 2.7, `Gamma`, whose value is our 1 / gamma). Its inverse is
    /// linear = full (DN / full)^gamma.
    Gamma {
        /// Exponent; 2.2 for images meant for display.
        gamma: f64,
    },
}

impl Default for CameraResponse {
    fn default() -> Self {
        Self::Linear {}
    }
}

impl CameraResponse {
    /// Returns whether the curve is non-linear.
    #[inline]
    pub fn is_bent(&self) -> bool {
        !matches!(self, Self::Linear {} | Self::Gamma { gamma: 1.0 })
    }

    /// Returns the frame DN, unrounded, for a linear DN in 0 to `full_scale`.
    #[inline]
    pub fn apply(&self, linear_dn: f64, full_scale: f64) -> f64 {
        match self {
            Self::Linear {} => linear_dn,
            Self::Gamma { gamma } => full_scale * (linear_dn / full_scale).powf(1.0 / gamma),
        }
    }

    /// Returns the linear DN, unrounded, for a frame DN: the inverse of [`Self::apply`].
    pub fn invert(&self, dn: f64, full_scale: f64) -> f64 {
        match self {
            Self::Linear {} => dn,
            Self::Gamma { gamma } => full_scale * (dn / full_scale).powf(*gamma),
        }
    }

    /// Fits a straight line to the variance of frame DN as a function of frame DN, between two
    /// linear DN (`ends`: dark, light). `variance` gives the variance of a linear DN. Returns the
    /// line's slope and its value at the dark end.
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
            // Average slope of the curve over one frame DN.
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
        // Neither coefficient of the line may be negative; a negative one is set to zero.
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
