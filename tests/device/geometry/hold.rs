//! Compares the reference renderer and the production renderer with a surface's closed form, at
//! every pixel.

use super::closed_form::{Rig, Surface};
use glam::DVec2;
use phasmid::emulator::Truth;
use phasmid::emulator::render::Renderer;
use phasmid::emulator::render::reference::Reference;
use phasmid::profile::{Profile, Scene};
use rayon::prelude::*;

pub fn bench() -> Profile {
    let mut profile = Profile::load("pmp-bench").unwrap();
    profile.projector.rotation_deg = [0.0, -3.0, 0.0];
    profile
}

pub fn scene(surface: &dyn Surface) -> Scene {
    let text = format!("name = \"s\"\ndescription = \"\"\n{}", surface.toml());
    Scene::parse(&text, "s").unwrap()
}

/// Requires, at every pixel in the projector's field, that the reference renderer is within 1e-9 px
/// of the closed form, and the production renderer within the larger of 1e-3 px and 1e-4 of the
/// footprint; visibility and illumination must match at every pixel. Returns the number of pixels
/// compared.
pub fn hold(profile: &Profile, surface: &dyn Surface) -> usize {
    let scene = scene(surface);
    let rig = Rig::new(profile);
    let truth = Renderer::new(profile, &scene, 1).unwrap().truth(&[]);
    let reference = Reference::new(profile, &scene).unwrap();
    let width = truth.width as usize;
    let what = format!("{} {:?}", surface.toml(), profile.camera.distortion);
    (0..truth.flags.len())
        .into_par_iter()
        .filter(|&i| {
            let px = DVec2::new((i % width) as f64, (i / width) as f64);
            let exact = rig.lit_from(surface, px);
            let seen = truth.flags[i] & Truth::SEEN != 0;
            assert_eq!(seen, exact.is_some(), "{what} {px}");
            let Some(exact) = exact else { return false };
            let lit = truth.flags[i] & Truth::LIT != 0;
            if !rig.in_field(exact) {
                assert!(!lit, "{what} {px}: lit from {exact}");
                return false;
            }
            if let Some(times) = surface.condition(&rig, px) {
                let found = reference.trace(px).map_or(DVec2::NAN, |f| f.projector_px);
                let error = (found - exact).abs().max_element();
                assert!(
                    error <= 1e-9 * times,
                    "{what} {px}: reference off by {error:e}"
                );
            }
            let fast = DVec2::new(truth.projector_x[i].into(), truth.projector_y[i].into());
            let error = (fast - exact).abs().max_element();
            let bar = 1e-3f64.max(1e-4 * rig.footprint(surface, px));
            assert!(error <= bar, "{what} {px}: off by {error:e}, bar {bar:e}");
            // These surfaces are in shadow only where they face away from the projector.
            assert_eq!(lit, rig.faces(surface, px), "{what} {px}: lit from {exact}");
            true
        })
        .count()
}
