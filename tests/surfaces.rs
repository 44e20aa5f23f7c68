//! What surfaces look like, against closed forms and against finer sampling.

use glam::{DVec2, DVec3};
use phasma::emulator::render::{Renderer, Term};
use phasma::emulator::{Shot, Slide, Truth};
use phasma::geometry::{Mesh, ply};
use phasma::profile::{Profile, Scene};
use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;

fn white(profile: &Profile) -> Shot {
    let level = (1 << profile.projector.bits) - 1;
    Shot {
        slide: Some(Arc::new(Slide::Uniform(level))),
        light: 1.0,
        exposure_ns: 8_000_000,
        ..Shot::default()
    }
}

fn scene(objects: &str, folder: &Path) -> Scene {
    let text = format!("name = \"s\"\ndescription = \"\"\n{objects}");
    let mut scene = Scene::parse(&text, "s").unwrap();
    scene.folder = folder.to_path_buf();
    scene
}

/// Digital numbers per W/m^2 on a white Lambertian surface, from the camera equation and the
/// photon's energy.
fn dn_per_irradiance(profile: &Profile, exposure_s: f64) -> f64 {
    let camera = &profile.camera;
    let area_m2 = (camera.sensor_width_mm / f64::from(camera.width_px) * 1e-3).powi(2);
    let photon_j = 6.626_070_15e-34 * 299_792_458.0 / (profile.projector.wavelength_nm * 1e-9);
    camera.sensor.quantum_efficiency * area_m2 * exposure_s * camera.sensor.gain_dn_per_e
        / (4.0 * camera.f_number.powi(2) * photon_j)
}

#[test]
fn a_highlight_on_a_plane_is_the_microfacet_formula() {
    let profile = Profile::load("pmp-bench").unwrap();
    let (f0, roughness) = (0.06, 0.35_f64);
    let scene = scene(
        &format!(
            "[[object]]\nshape = {{ kind = \"plane\" }}\nposition_mm = [0, 0, 1000]\n\
             rotation_deg = [3, -11, 0]\nalbedo = 0.0\n\
             specular = {{ f0 = {f0}, roughness = {roughness} }}\n"
        ),
        Path::new(""),
    );
    let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
    let truth = renderer.truth(&[]);
    let shot = white(&profile);
    let found = renderer.expected_dn(&shot);
    let projector = profile.projector.view().center();
    let normal = scene.object[0].scene_from_object().direction(DVec3::NEG_Z);
    let scale = dn_per_irradiance(&profile, 8e-3);
    let (mut compared, mut brightest) = (0, 0.0f64);
    for i in (0..found.len()).filter(|&i| truth.flags[i] & Truth::LIT != 0) {
        let px = DVec2::new((i % 1138) as f64, (i / 1138) as f64);
        let ray = profile.camera.view().ray(px);
        let point = ray / ray.z * f64::from(truth.depth_mm[i]);
        let (way, view) = (projector - point, -point.normalize());
        let light = way.normalize();
        let half = (light + view).normalize();
        // Walter et al. 2007 equation 33, Heitz 2014 equations 72 and 99, Schlick 1994.
        let a2 = roughness.powi(4);
        let tan2 = |c: f64| (1.0 - c * c) / (c * c);
        let c = normal.dot(half);
        let d = a2 / (PI * c.powi(4) * (a2 + tan2(c)).powi(2));
        let lambda = |c: f64| (-1.0 + (1.0 + a2 * tan2(c)).sqrt()) / 2.0;
        let (cl, cv) = (normal.dot(light), normal.dot(view));
        let g2 = 1.0 / (1.0 + lambda(cl) + lambda(cv));
        let f = f0 + (1.0 - f0) * (1.0 - view.dot(half)).powi(5);
        let brdf = d * g2 * f / (4.0 * cl * cv);
        let irradiance =
            profile.projector.radiant_intensity_w_sr * cl / (way.length_squared() * 1e-6);
        let exact = profile.camera.sensor.black_level_dn + scale * irradiance * PI * brdf;
        if exact > 250.0 || truth.flags[i] & Truth::CREASE != 0 {
            continue;
        }
        compared += 1;
        brightest = brightest.max(exact);
        let error = (f64::from(found[i]) - exact).abs();
        assert!(error < 1e-3 + 1e-5 * exact, "({px}): {} {exact}", found[i]);
    }
    assert!(
        compared > 50_000 && brightest > 30.0,
        "{compared} {brightest}"
    );
}

/// A sphere of longitudes and latitudes.
fn ball(radius: f64, across: u32) -> Mesh {
    let (columns, rows) = (2 * across, across);
    let mut mesh = Mesh::default();
    for j in 0..=rows {
        for i in 0..columns {
            let (lat, lon) = (
                PI * f64::from(j) / f64::from(rows),
                2.0 * PI * f64::from(i) / f64::from(columns),
            );
            let ring = lat.sin();
            mesh.vertices
                .push(DVec3::new(ring * lon.cos(), lat.cos(), ring * lon.sin()) * radius);
        }
    }
    let at = |i: u32, j: u32| j * columns + i % columns;
    for j in 0..rows {
        for i in 0..columns {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

#[test]
fn facets_do_not_glint() {
    let profile = Profile::load("pmp-bench").unwrap();
    let dir = tempfile::tempdir().unwrap();
    ply::write_mesh(&dir.path().join("ball.ply"), &ball(75.0, 60)).unwrap();
    let image = |shape: &str| {
        let scene = scene(
            &format!(
                "[[object]]\nshape = {{ {shape} }}\nposition_mm = [0, 0, 940]\nalbedo = 0.1\n\
                 specular = {{ f0 = 0.04, roughness = 0.4 }}\n"
            ),
            dir.path(),
        );
        let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
        assert!(renderer.plan().has(Term::Specular));
        let flags = renderer.truth(&[]).flags;
        let dn = renderer.expected_dn(&white(&profile));
        renderer.force(Term::Specular, false);
        (flags, dn, renderer.expected_dn(&white(&profile)))
    };
    let (flags, round, dull) = image("kind = \"sphere\", radius_mm = 75.0");
    let (mesh_flags, facets, _) = image("kind = \"mesh\", file = \"ball.ply\"");
    let peak = round
        .iter()
        .zip(&dull)
        .map(|(r, d)| r - d)
        .fold(0.0, f32::max);
    assert!(peak > 15.0, "a highlight: {peak}");
    let well = Truth::LIT | Truth::SQUARE;
    let (mut compared, mut worst) = (0, 0.0f32);
    for i in 0..round.len() {
        let both = flags[i] & mesh_flags[i];
        if both & well != well || (flags[i] | mesh_flags[i]) & Truth::CREASE != 0 {
            continue;
        }
        compared += 1;
        worst = worst.max((round[i] - facets[i]).abs());
    }
    // Facets of 3 degrees: flat ones would differ by a good part of the highlight.
    assert!(
        compared > 3000 && worst < 0.03 * peak,
        "{compared}: {worst} of {peak}"
    );
}

#[test]
fn a_mirror_of_a_surface_saturates_and_stays_a_number() {
    let profile = Profile::load("pmp-bench").unwrap();
    let scene = scene(
        "[[object]]\nshape = { kind = \"sphere\", radius_mm = 75.0 }\nposition_mm = [0, 0, 940]\n\
         albedo = 0.0\nspecular = { f0 = 1.0, roughness = 0.05 }\n",
        Path::new(""),
    );
    let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
    let dn = renderer.expected_dn(&white(&profile));
    assert!(
        dn.iter()
            .all(|v| v.is_finite() && (0.0..=255.0).contains(v))
    );
    assert!(dn.iter().any(|&v| v > 254.9));
    let frame = renderer.expose(&white(&profile));
    assert!(frame.data.contains(&255));
}
