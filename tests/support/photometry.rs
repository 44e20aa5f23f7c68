//! Shared by tests of light: parses scenes from a few lines, and converts irradiance to digital
//! numbers.

use phasmid::profile::{Profile, Scene};
use std::path::Path;

/// Parses a scene from a few lines of TOML; its files are in `folder`.
pub fn scene(lines: &str, folder: &Path) -> Scene {
    let text = format!("name = \"s\"\ndescription = \"\"\n{lines}");
    let mut scene = Scene::parse(&text, "s").unwrap();
    scene.folder = folder.to_path_buf();
    scene
}

/// Returns the digital numbers per W/m^2 on a white Lambertian surface, from the camera equation and
/// the energy of a photon.
pub fn dn_per_irradiance(profile: &Profile, exposure_s: f64) -> f64 {
    let camera = &profile.camera;
    let area_m2 = (camera.sensor_width_mm / f64::from(camera.width_px) * 1e-3).powi(2);
    let photon_j = 6.626_070_15e-34 * 299_792_458.0 / (profile.projector.wavelength_nm * 1e-9);
    camera.sensor.quantum_efficiency * area_m2 * exposure_s * camera.sensor.gain_dn_per_e
        / (4.0 * camera.f_number.powi(2) * photon_j)
}
