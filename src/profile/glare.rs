//! Veiling glare of a camera's lens.

use phasmid_core::check::Check;
use phasmid_core::error::Result;
use serde::{Deserialize, Serialize};

/// Light that the lens scatters over the image: the halo about strong light (ISO 9358 measures it
/// as the veiling glare index, the share of a white field's light that lands in a black hole).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Glare {
    /// Per cent of each point's light that is scattered.
    pub percent: f64,
    /// Standard deviation in pixels of the Gaussian that it is scattered over; what would fall
    /// beside the image is reflected into it, so that no light is lost.
    pub sigma_px: f64,
}

pub(super) fn check(glare: Glare, check: &Check<'_>) -> Result<()> {
    check.within("camera.glare.percent", glare.percent, 0.0..=100.0)?;
    check.within("camera.glare.sigma_px", glare.sigma_px, 32.0..=32768.0)
}
