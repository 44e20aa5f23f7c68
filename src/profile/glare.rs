//! Veiling glare of a camera's lens.

use phasmid_core::check::Check;
use phasmid_core::error::Result;
use serde::{Deserialize, Serialize};

/// Light that the lens scatters over the image, as in the halo around a bright source. ISO 9358
/// measures it as the veiling glare index: the fraction of a white field's light that falls on a
/// black hole.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Glare {
    /// Percentage of each point's light that is scattered.
    pub percent: f64,
    /// Standard deviation of the Gaussian scattering kernel in pixel widths, the same in every
    /// direction on the sensor. Light that would fall outside the image is reflected back into it,
    /// so that none is lost.
    pub sigma_px: f64,
}

pub(super) fn check(glare: Glare, check: &Check<'_>) -> Result<()> {
    check.within("camera.glare.percent", glare.percent, 0.0..=100.0)?;
    check.within("camera.glare.sigma_px", glare.sigma_px, 32.0..=32768.0)
}
