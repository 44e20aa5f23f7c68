//! Interreflection compared with form factors and with direct integration.

mod bounds;
mod energy;
mod error;
mod pattern_images;
mod wedge;

use crate::photometry::{dn_per_irradiance, scene};
use glam::{DVec2, DVec3};
use phasmid::emulator::render::{Renderer, Term};
use phasmid::emulator::{PatternImage, Shot, Truth};
use phasmid::geometry::{Mesh, ply};
use phasmid::pattern::{Axis, Pattern};
use phasmid::profile::{Profile, Scene};
use std::f64::consts::FRAC_1_SQRT_2;
use std::path::Path;
use std::sync::Arc;

/// Albedos of the two walls of the wedges.
const ALBEDO: [f64; 2] = [0.8, 0.6];
/// Line along which the walls meet, parallel to y.
const CREASE: DVec3 = DVec3::new(0.0, 0.0, 1050.0);
/// Directions in which the walls extend from the crease; the direction of each wall is the normal of
/// the other.
const OUT: [DVec3; 2] = [
    DVec3::new(-FRAC_1_SQRT_2, 0.0, -FRAC_1_SQRT_2),
    DVec3::new(FRAC_1_SQRT_2, 0.0, -FRAC_1_SQRT_2),
];
/// Widths of the two walls, and their common length, in millimetres.
const WIDTH: [f64; 2] = [300.0, 200.0];
const LENGTH: f64 = 20_000.0;

/// Returns a scene with the walls as solids.
fn solid_walls() -> String {
    let wall = |i: usize| {
        let at = CREASE + OUT[i] * (WIDTH[i] / 2.0);
        let turn = if i == 0 { -45.0 } else { 45.0 };
        format!(
            "[[object]]\nshape = {{ kind = \"plane\", size_mm = [{}, {LENGTH}] }}\n\
             position_mm = [{:.12}, 0, {:.12}]\nrotation_deg = [0, {turn}, 0]\nalbedo = {}\n",
            WIDTH[i], at.x, at.z, ALBEDO[i]
        )
    };
    wall(0) + &wall(1)
}

/// Returns a scene with the walls as meshes, each made of strips along y, whose files are in
/// `folder`. The scene is scaled about the camera.
fn mesh_walls(folder: &Path, scale: f64) -> String {
    let mut text = String::new();
    for i in 0..2 {
        let mut mesh = Mesh::default();
        let strips = 7;
        for k in 0..=strips {
            let along = CREASE + OUT[i] * (WIDTH[i] * f64::from(k) / f64::from(strips));
            let half = DVec3::Y * (LENGTH / 2.0);
            mesh.vertices.extend([along - half, along + half]);
        }
        for k in (0..2 * strips).step_by(2) {
            mesh.triangles
                .extend([[k, k + 1, k + 2], [k + 1, k + 3, k + 2]]);
        }
        let file = format!("wall{i}.ply");
        ply::write_mesh(&folder.join(&file), &mesh).unwrap();
        text += &format!(
            "[[object]]\nshape = {{ kind = \"mesh\", file = \"{file}\" }}\nscale = {scale}\n\
             albedo = {}\n",
            ALBEDO[i]
        );
    }
    text
}

/// Returns a distant light perpendicular to the second wall and parallel to the first.
fn lamp() -> String {
    format!(
        "[[light]]\nkind = \"directional\"\ndirection = [{}, 0, {}]\nirradiance_w_m2 = 1.0\n",
        -OUT[0].x, -OUT[0].z
    )
}

fn wanted(samples: u32, step_px: u32) -> String {
    format!("interreflection = {{ samples = {samples}, step_px = {step_px} }}\n")
}

fn shot(pattern_image: Option<PatternImage>) -> Shot {
    Shot {
        pattern_image: pattern_image.map(Arc::new),
        light: 1.0,
        exposure_ns: 8_000_000,
        ..Shot::default()
    }
}

/// Returns the interreflected irradiance of all pixels in W/m^2, times albedo, as the difference
/// with and without the term.
fn bounced(profile: &Profile, renderer: &mut Renderer, shot: &Shot) -> Vec<f64> {
    assert!(renderer.plan().has(Term::Interreflection));
    let with = renderer.expected_dn(shot);
    renderer.force(Term::Interreflection, false);
    let without = renderer.expected_dn(shot);
    renderer.force(Term::Interreflection, true);
    let scale = dn_per_irradiance(profile, 8e-3);
    let pairs = with.iter().zip(&without);
    pairs
        .map(|(a, b)| (f64::from(*a) - f64::from(*b)) / scale)
        .collect()
}

/// Returns the points that pixels see, in the rig's frame, each with the indices of its pixel and
/// its wall; pixels on edges are left out.
fn on_walls(profile: &Profile, truth: &Truth) -> Vec<(usize, usize, DVec3)> {
    let view = profile.camera.view();
    (0..truth.flags.len())
        .filter(|&i| truth.flags[i] & (Truth::SEEN | Truth::CREASE) == Truth::SEEN)
        .map(|i| {
            let px = DVec2::new((i % 1138) as f64, (i / 1138) as f64);
            let ray = view.ray(px);
            let point = ray / ray.z * f64::from(truth.depth_mm[i]);
            let wall = usize::from(point.x > 0.0);
            (i, wall, point)
        })
        .collect()
}

fn fringe(profile: &Profile, axis: Axis, period_px: f64) -> PatternImage {
    let pattern = Pattern::Fringe {
        axis,
        period_px,
        phase_rad: 0.4,
    };
    PatternImage::new(&pattern, &profile.projector, &|_| unreachable!()).unwrap()
}

fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
}

/// Returns a scene with a box around a ball, in front of a wall, so that every surface sees at
/// least one other surface.
fn clutter(samples: u32, step_px: u32) -> Scene {
    let text = format!(
        "{}ambient = {{ irradiance_w_m2 = 0.02 }}\n[[light]]\nkind = \"point\"\n\
         position_mm = [-300, 200, 400]\nintensity_w_sr = 0.04\n\
         flicker = {{ frequency_hz = 100, depth = 0.4 }}\n{}\
         [[object]]\nshape = {{ kind = \"sphere\", radius_mm = 60.0 }}\n\
         position_mm = [0, 0, 940]\nalbedo = 0.8\n\
         specular = {{ f0 = 0.05, roughness = 0.5 }}\n",
        wanted(samples, step_px),
        solid_walls()
    );
    scene(&text, Path::new(""))
}
