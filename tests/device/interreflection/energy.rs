//! Conservation of energy inside a sphere, with highlights and textures.

use crate::interreflection::*;
use crate::photometry::{dn_per_irradiance, scene};
use phasmid::emulator::render::Renderer;
use phasmid::profile::Profile;
use std::path::Path;

/// Inside a sphere, every point sees every other point in proportion to its area, whatever the
/// angles (e.g. Howell, Menguc, Siegel, "Thermal Radiation Heat Transfer"). One reflection therefore
/// adds, at every point, the albedo times the mean irradiance, which follows from the lamp's total
/// power.
#[test]
fn interreflection_in_a_sphere_is_uniform_and_exact() {
    let profile = Profile::load("pmp-bench").unwrap();
    let (radius, albedo, intensity) = (500.0, 0.7, 0.05);
    for (samples, bar) in [(64, 0.03), (256, 0.01)] {
        let text = format!(
            "{}[[light]]\nkind = \"point\"\nposition_mm = [120, -60, 90]\n\
             intensity_w_sr = {intensity}\n[[object]]\n\
             shape = {{ kind = \"sphere\", radius_mm = {radius} }}\nalbedo = {albedo}\n",
            wanted(samples, 8)
        );
        let mut renderer = Renderer::new(&profile, &scene(&text, Path::new("")), 1).unwrap();
        let found = bounced(&profile, &mut renderer, &shot(None));
        let exact = albedo * albedo * intensity * 1e6 / (radius * radius);
        let errors: Vec<f64> = found.iter().map(|f| f / exact - 1.0).collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        assert!(rms(&errors) < bar && mean.abs() < bar / 5.0);
    }
}

/// Energy is conserved inside a sphere with an albedo of 1, once with specular highlights and once
/// with a fine chequered texture. Results are relative to each pixel's response to uniform light,
/// because each pixel averages a different part of the texture.
#[test]
fn highlights_and_pictures_keep_the_energy() {
    let mut profile = Profile::load("pmp-bench").unwrap();
    profile.camera.height_px = 163;
    let folder = tempfile::tempdir().unwrap();
    let chequered =
        image::GrayImage::from_fn(2, 2, |x, y| image::Luma([255 * ((x + y) % 2) as u8]));
    chequered.save(folder.path().join("chequered.png")).unwrap();
    let (radius, intensity) = (500.0, 0.02);
    for (look, mean_share, bar) in [
        ("specular = { f0 = 0.3, roughness = 0.5 }", 1.0, 0.01),
        (
            "texture = \"chequered.png\"\ntexture_size_mm = [4, 4]",
            0.5,
            0.03,
        ),
    ] {
        let inside = |light: &str| {
            let text = format!(
                "{}{light}[[object]]\nshape = {{ kind = \"sphere\", radius_mm = {radius} }}\n\
                 albedo = 1.0\n{look}\n",
                wanted(256, 8)
            );
            Renderer::new(&profile, &scene(&text, folder.path()), 1).unwrap()
        };
        let lamp = format!(
            "[[light]]\nkind = \"point\"\nposition_mm = [120, -60, 90]\n\
             intensity_w_sr = {intensity}\n"
        );
        let found = bounced(&profile, &mut inside(&lamp), &shot(None));
        // Response of each pixel to 0.5 W/m^2 of uniform light.
        let even = inside("ambient = { irradiance_w_m2 = 0.5 }\n").expected_dn(&shot(None));
        let (black, scale) = (4.0, dn_per_irradiance(&profile, 8e-3));
        let exact = mean_share * intensity * 1e6 / (radius * radius);
        let errors: Vec<f64> = found
            .iter()
            .zip(even)
            .filter(|(_, even)| *even > black + 10.0)
            .map(|(found, even)| found * 0.5 * scale / f64::from(even - black) / exact - 1.0)
            .collect();
        assert!(errors.len() > 70_000, "{}", errors.len());
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        assert!(
            rms(&errors) < bar && mean.abs() < bar / 5.0,
            "{look}: {} {mean}",
            rms(&errors)
        );
    }
}
