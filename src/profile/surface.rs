//! Specular reflection of an object's surface.

use phasmid_core::check::Check;
use phasmid_core::error::Result;
use serde::{Deserialize, Serialize};

/// A GGX microfacet lobe on top of the diffuse reflection. The diffuse part reflects `albedo` of
/// the light the lobe transmits. A highlight narrower than a pixel is sampled at the pixel's
/// centre.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Specular {
    /// Reflectance at normal incidence, 0 to 1: ((n - 1)/(n + 1))^2 of a dielectric, so 0.04 for
    /// plastics and glass (n = 1.5) and 0.028 for skin (n = 1.4).
    pub f0: f64,
    /// Perceptual roughness, 0.05 to 1; GGX's alpha is its square (Burley, "Physically Based
    /// Shading at Disney", SIGGRAPH 2012).
    pub roughness: f64,
}

pub(super) fn check(specular: &Specular, at: &str, check: &Check<'_>) -> Result<()> {
    check.within(&format!("{at}.f0"), specular.f0, 0.0..=1.0)?;
    check.within(&format!("{at}.roughness"), specular.roughness, 0.05..=1.0)
}
