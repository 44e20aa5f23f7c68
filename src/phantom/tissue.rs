//! Optical properties of skin, a material with subsurface scattering.

use phasmid_core::check::Check;
use phasmid_core::error::Result;
use serde::{Deserialize, Serialize};

/// Optical properties of skin, by class or by coefficients at the projector's wavelength. The
/// derived quantities and their sources are in `phasmid_render::skin`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Skin {
    /// Fitzpatrick class, 1 (palest) to 6: melanin of the epidermis over the same dermis. For
    /// wavelengths of 310 to 1000 nm; outside this range, the absorption of blood at the nearer
    /// limit is used.
    #[serde(default)]
    pub fitzpatrick: Option<u8>,
    /// Absorption coefficient in 1/mm, instead of a class.
    #[serde(default)]
    pub absorption_per_mm: Option<f64>,
    /// Reduced scattering coefficient in 1/mm, given with the absorption.
    #[serde(default)]
    pub reduced_scattering_per_mm: Option<f64>,
    /// Refractive index; default 1.4 (Jacques, Physics in Medicine and Biology 58, 2013).
    #[serde(default = "index")]
    pub refractive_index: f64,
}

fn index() -> f64 {
    1.4
}

/// Checks the properties of skin at the place `at` of a document.
///
/// # Errors
/// Returns an error with the line if it has both a class and coefficients, or neither, or if a value
/// is out of range.
pub fn check(skin: &Skin, at: &str, check: &Check<'_>) -> Result<()> {
    let field = |name: &str| format!("{at}.{name}");
    let coefficients = [skin.absorption_per_mm, skin.reduced_scattering_per_mm];
    let given = coefficients.iter().flatten().count();
    let found = match (skin.fitzpatrick, given) {
        (Some(_), 0) | (None, 2) => None,
        (Some(_), _) => Some("a class and coefficients"),
        (None, 0) => Some("neither a class nor coefficients"),
        (None, _) => Some("one coefficient of two"),
    };
    check.that(
        found.is_none(),
        at,
        found.unwrap_or_default(),
        "fitzpatrick, or absorption_per_mm and reduced_scattering_per_mm",
    )?;
    if let Some(class) = skin.fitzpatrick {
        check.within(&field("fitzpatrick"), u32::from(class), 1..=6)?;
    }
    if let Some(absorption) = skin.absorption_per_mm {
        check.within(&field("absorption_per_mm"), absorption, 1e-3..=100.0)?;
    }
    if let Some(scattering) = skin.reduced_scattering_per_mm {
        check.within(&field("reduced_scattering_per_mm"), scattering, 0.1..=1e4)?;
    }
    check.within(&field("refractive_index"), skin.refractive_index, 1.0..=1.6)
}
