//! Light in a scene that is not the projector's.

use super::check::Check;
use crate::error::Result;
use serde::{Deserialize, Serialize};

/// Constant light that falls on every surface alike.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ambient {
    /// Irradiance in W/m^2 at the projector's wavelength.
    pub irradiance_w_m2: f64,
}

pub(super) fn check(ambient: &Ambient, check: &Check<'_>) -> Result<()> {
    check.within(
        "ambient.irradiance_w_m2",
        ambient.irradiance_w_m2,
        0.0..=1e6,
    )
}
