//! Composition of skin for each Fitzpatrick class.
//!
//! Jacques, "Skin Optics", Oregon Medical Laser Center News, January 1998
//! (omlc.org/news/jan98/skinoptics.html): melanosomes in an epidermis of 60 um over a dermis with
//! 0.2 % of blood. Jacques, "Optical properties of biological tissues: a review", Physics in
//! Medicine and Biology 58, R37 (2013), table 1: scattering of skin.

use super::{Tissue, blood};
use phasmid_profile as profile;

/// Volume fraction of melanosomes in the epidermis for each class. Jacques gives ranges for lightly
/// (1.3 to 6.3 %), moderately (11 to 16 %) and darkly pigmented skin (18 to 43 %). The values within
/// these ranges are our choice: both ends and the middle of the first range, the middle of the
/// second, and the lower end and the middle of the third.
const MELANOSOMES: [f64; 6] = [0.013, 0.038, 0.063, 0.135, 0.18, 0.305];
/// Thickness of the epidermis in centimetres.
const EPIDERMIS_CM: f64 = 0.006;
/// Volume fraction of blood in the dermis, and oxygenated fraction of its haemoglobin.
const BLOOD: f64 = 0.002;
const OXYGENATED: f64 = 0.75;

/// Skin at one wavelength: a scattering tissue under an absorbing filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layers {
    /// Scattering tissue.
    pub tissue: Tissue,
    /// Transmission of the epidermis for light that passes it twice (in and out), 0 to 1. The
    /// epidermis is thin compared to the scattering length, so it attenuates light without spreading
    /// it.
    pub filter: f64,
}

impl Layers {
    /// Creates the layers from a scene's skin parameters at a wavelength in nanometres.
    pub fn new(skin: &profile::Skin, wavelength_nm: f64) -> Self {
        let (coefficients, filter) = match *skin {
            profile::Skin {
                absorption_per_mm: Some(absorption),
                reduced_scattering_per_mm: Some(scattering),
                ..
            } => ((absorption, scattering), 1.0),
            _ => {
                let class = skin.fitzpatrick.unwrap_or(1);
                (
                    dermis_per_mm(wavelength_nm),
                    epidermis(class, wavelength_nm),
                )
            }
        };
        Self {
            tissue: Tissue {
                absorption_per_mm: coefficients.0,
                reduced_scattering_per_mm: coefficients.1,
                refractive_index: skin.refractive_index,
            },
            filter,
        }
    }

    /// Returns the diffuse reflectance under uniform light, which is the albedo of skin.
    pub fn reflectance(&self) -> f64 {
        self.filter * self.tissue.reflectance(0.0)
    }
}

/// Returns the absorption in 1/cm of skin without melanin and blood.
fn baseline_per_cm(nm: f64) -> f64 {
    0.244 + 85.3 * (-(nm - 154.0) / 66.2).exp()
}

/// Returns the absorption and reduced scattering coefficients of the dermis in 1/mm.
fn dermis_per_mm(nm: f64) -> (f64, f64) {
    let blood = blood::absorption_per_cm(nm, OXYGENATED);
    let absorption = BLOOD * blood + (1.0 - BLOOD) * baseline_per_cm(nm);
    let scattering = 46.0 * (nm / 500.0).powf(-1.421);
    (absorption / 10.0, scattering / 10.0)
}

/// Returns the transmission of two passes through the epidermis at normal incidence.
fn epidermis(class: u8, nm: f64) -> f64 {
    let part = MELANOSOMES[usize::from(class.clamp(1, 6)) - 1];
    let melanosome = 6.6e11 * nm.powf(-3.33);
    let absorption = part * melanosome + (1.0 - part) * baseline_per_cm(nm);
    (-2.0 * absorption * EPIDERMIS_CM).exp()
}
