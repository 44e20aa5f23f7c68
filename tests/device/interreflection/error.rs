//! Settings of interreflection that are chosen by an error bound, and the light of further bounces.

use crate::interreflection::*;
use crate::photometry::scene;
use phasmid::emulator::PatternImage;
use phasmid::emulator::render::Renderer;
use phasmid::profile::Profile;
use std::path::Path;

/// Black level of `pmp-bench` in DN.
const BLACK: f32 = 4.0;

/// Returns a profile with an eighth of the columns and rows, so that each pixel receives 64 times
/// the light.
fn small() -> Profile {
    let mut profile = Profile::load("pmp-bench").unwrap();
    profile.camera.width_px = 142;
    profile.camera.height_px = 61;
    profile.projector.radiant_intensity_w_sr = 0.2 / 64.0;
    profile
}

fn white() -> Shot {
    shot(Some(PatternImage::Uniform(255)))
}

/// Returns the smallest value that at least the fraction `part` of the values does not exceed.
fn quantile(mut values: Vec<f32>, part: f64) -> f64 {
    values.sort_by(f32::total_cmp);
    f64::from(values[((values.len() - 1) as f64 * part) as usize])
}

#[test]
fn settings_follow_from_the_error_bound() {
    let profile = small();
    let renderer = |settings: &str| {
        let text = format!("interreflection = {{ {settings} }}\n{}", solid_walls());
        Renderer::new(&profile, &scene(&text, Path::new("")), 1).unwrap()
    };
    let mut reference = renderer("samples = 1024, step_px = 1");
    let exact = reference.expected_dn(&white());
    reference.force(Term::Interreflection, false);
    let direct = reference.expected_dn(&white());
    let mut costs = Vec::new();
    for bound in [0.4, 1.0, 10.0] {
        let mut renderer = renderer(&format!("error_percent = {bound}"));
        let found = renderer.expected_dn(&white());
        let light = renderer.indirect_light().unwrap();
        assert_eq!(light.bound_percent, Some(bound));
        assert!(light.error_percent <= bound, "{light:?}");
        let lit = (0..exact.len()).filter(|&i| direct[i] > BLACK + 2.0);
        let errors: Vec<f32> = lit
            .map(|i| 100.0 * (found[i] - exact[i]).abs() / (exact[i] - BLACK))
            .collect();
        assert!(errors.len() > 900, "{}", errors.len());
        let error = quantile(errors, 0.99);
        println!("bound {bound} %: {error:.3} % in 99 % of the pixels, {light:?}");
        assert!(error <= 1.5 * bound, "{error} {light:?}");
        costs.push(f64::from(light.samples) / f64::from(light.step_px).powi(2));
    }
    assert!(costs[0] > costs[1] && costs[1] > costs[2], "{costs:?}");
    // Settings given in the scene are used, whatever error they cause.
    let light = renderer("samples = 16, step_px = 8")
        .indirect_light()
        .unwrap();
    assert_eq!(
        (light.samples, light.step_px, light.bound_percent),
        (16, 8, None)
    );
    assert!(light.error_percent > 0.5, "{light:?}");
}

/// Inside a sphere each bounce is uniform and has the previous bounce's light times the albedo,
/// whatever the light.
#[test]
fn further_bounces_in_a_sphere_are_a_geometric_series() {
    let (mut profile, albedo) = (small(), 0.7);
    // Half the distance gives four times the light, so the projector's intensity is divided by four.
    profile.projector.radiant_intensity_w_sr /= 4.0;
    let text = format!(
        "interreflection = {{ samples = 256 }}\n[[object]]\n\
         shape = {{ kind = \"sphere\", radius_mm = 500 }}\nalbedo = {albedo}\n"
    );
    let mut renderer = Renderer::new(&profile, &scene(&text, Path::new("")), 1).unwrap();
    // A single sphere counts as convex, so interreflection must be forced.
    renderer.force(Term::Interreflection, true);
    let total = renderer.expected_dn(&white());
    renderer.force(Term::Interreflection, false);
    let direct = renderer.expected_dn(&white());
    renderer.force(Term::Interreflection, true);
    let lit = total
        .iter()
        .zip(&direct)
        .filter(|(_, direct)| **direct > BLACK + 1e-3);
    let further: Vec<f32> = lit
        .map(|(total, direct)| (total - direct) * albedo / (1.0 - albedo) / (total - BLACK))
        .collect();
    let light = renderer.indirect_light().unwrap();
    // The light of further bounces is sampled at 64 pixels, and varies by a factor of several.
    for (found, part) in [
        (light.further_percent, 0.5),
        (light.most_further_percent, 0.95),
    ] {
        let wanted = 100.0 * quantile(further.clone(), part);
        assert!(
            (found / wanted - 1.0).abs() < 0.1,
            "{part}: {found} {wanted}"
        );
    }
}
