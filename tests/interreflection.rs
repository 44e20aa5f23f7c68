//! Light that surfaces throw on each other, against form factors and direct integration.

mod photometry;

use glam::{DVec2, DVec3};
use phasma::emulator::render::{Renderer, Term};
use phasma::emulator::{Shot, Shutter, Slide, Truth};
use phasma::geometry::{Mesh, ply};
use phasma::pattern::{Axis, Pattern};
use phasma::profile::{Profile, Scene};
use photometry::{dn_per_irradiance, scene};
use rayon::prelude::*;
use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};
use std::path::Path;
use std::sync::Arc;

/// Albedos of the two walls of the wedges.
const ALBEDO: [f64; 2] = [0.8, 0.6];
/// Where the walls meet: a line along y.
const CREASE: DVec3 = DVec3::new(0.0, 0.0, 1050.0);
/// Directions in which the walls leave the crease; each is the other's normal.
const OUT: [DVec3; 2] = [
    DVec3::new(-FRAC_1_SQRT_2, 0.0, -FRAC_1_SQRT_2),
    DVec3::new(FRAC_1_SQRT_2, 0.0, -FRAC_1_SQRT_2),
];
/// Their widths and their length in millimetres.
const WIDTH: [f64; 2] = [300.0, 200.0];
const LENGTH: f64 = 20_000.0;

/// The walls as closed forms.
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

/// The walls as meshes, each of strips along y, in files of `folder`; scaled about the camera.
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

/// Light from far away that meets the second wall squarely and the first one edge-on.
fn lamp() -> String {
    format!(
        "[[light]]\nkind = \"directional\"\ndirection = [{}, 0, {}]\nirradiance_w_m2 = 1.0\n",
        -OUT[0].x, -OUT[0].z
    )
}

fn wanted(samples: u32, step_px: u32) -> String {
    format!("interreflection = {{ samples = {samples}, step_px = {step_px} }}\n")
}

fn shot(slide: Option<Slide>) -> Shot {
    Shot {
        slide: slide.map(Arc::new),
        light: 1.0,
        exposure_ns: 8_000_000,
        ..Shot::default()
    }
}

/// Irradiance in W/m^2 that bounces, times albedo, of all pixels: what the term adds.
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

/// Points in the rig's frame that pixels see, with the wall that they are on, pixels on edges
/// excepted.
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

/// Share of the sky of a point of the first wall that the second one fills: twice the form factor
/// of an element to a perpendicular rectangle, with a corner across from it (Howell, "A Catalog of
/// Radiation Heat Transfer Configuration Factors", B-5).
fn wedge_factor(point: DVec3) -> f64 {
    let d = OUT[0].dot(point - CREASE);
    let far = d.hypot(WIDTH[1]);
    let corner = |b: f64| ((b / d).atan() - d / far * (b / far).atan()) / TAU;
    corner(LENGTH / 2.0 - point.y) + corner(LENGTH / 2.0 + point.y)
}

/// A renderer's errors in the wedge, scaled about the camera and lit by the lamp, in form factors.
fn wedge_errors(walls: &str, folder: &Path, samples: u32, scale: f64) -> Vec<f64> {
    let profile = Profile::load("pmp-bench").unwrap();
    let text = format!("{}{}{walls}", wanted(samples, 8), lamp());
    let mut renderer = Renderer::new(&profile, &scene(&text, folder), 1).unwrap();
    let found = bounced(&profile, &mut renderer, &shot(None));
    let truth = renderer.truth(&[]);
    let mut errors = Vec::new();
    for (i, wall, point) in on_walls(&profile, &truth) {
        if wall == 1 {
            // The first wall is dark: nothing comes back.
            assert!(found[i].abs() < 1e-6, "{i}: {}", found[i]);
        } else if i % 1138 % 8 == 0 && i / 1138 % 8 == 0 {
            errors.push(found[i] / (ALBEDO[0] * ALBEDO[1]) - wedge_factor(point / scale));
        }
    }
    // Light along the first wall may or may not light it, by rounding: its edges do not count.
    assert!(errors.len() > 500, "{}", errors.len());
    errors
}

fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
}

#[test]
fn a_right_angled_wedge_has_the_form_factors_profile() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = |scale| (mesh_walls(folder.path(), scale), scale);
    // Also from 50 mm and from 100 m away.
    for (walls, scale) in [(solid_walls(), 1.0), mesh(1.0), mesh(0.05), mesh(100.0)] {
        let of = |samples| wedge_errors(&walls, folder.path(), samples, scale);
        let (few, many) = (of(64), of(1024));
        let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len() as f64;
        let worst = many.iter().fold(0.0f64, |w, e| w.max(e.abs()));
        // Half of the sky at the most is the other wall's.
        assert!(rms(&many) < 0.0025 && worst < 0.01);
        assert!(mean(&many).abs() < 5e-4 && mean(&few).abs() < 2e-3);
        assert!(rms(&few) > 4.0 * rms(&many), "errors fall with the samples");
    }
}

/// Under a rolling shutter each row sees moving walls at its own time; the light between them is
/// that of walls that stand still, for they stay what they are to each other.
#[test]
fn walls_that_move_while_rows_start_bounce_as_still_ones_do() {
    let profile = Profile::load("pmp-bench").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let walls = mesh_walls(folder.path(), 1.0);
    // Toward the camera by 1.5 mm while the rows start.
    let motion = "motion = { keyframes = [{ time_s = 0.0, position_mm = [0, 0, 0] }, \
                  { time_s = 10.0, position_mm = [0, 0, -1000] }] }\nalbedo";
    let text = format!("{}{}{walls}", wanted(64, 8), lamp());
    let mut renderer = Renderer::new(&profile, &scene(&text, folder.path()), 1).unwrap();
    let still = bounced(&profile, &mut renderer, &shot(None));
    let rolling = Shot {
        shutter: Shutter {
            line_time_ns: 30_000,
            first_row: 0,
            rows: profile.camera.height_px,
        },
        ..shot(None)
    };
    let mut rolls = profile.clone();
    rolls.camera.line_time_us = 30.0;
    let text = format!(
        "{}{}{}",
        wanted(64, 8),
        lamp(),
        walls.replace("albedo", motion)
    );
    let mut renderer = Renderer::new(&rolls, &scene(&text, folder.path()), 1).unwrap();
    assert!(renderer.plan().has(Term::RollingShutter) && renderer.plan().has(Term::Motion));
    let moving = bounced(&profile, &mut renderer, &rolling);
    let errors: Vec<f64> = still.iter().zip(&moving).map(|(a, b)| a - b).collect();
    assert!(rms(&still) > 0.03, "{}", rms(&still));
    assert!(
        rms(&errors) < 0.05 * rms(&still),
        "{} {}",
        rms(&errors),
        rms(&still)
    );
}

#[test]
fn the_mean_over_a_strip_is_its_view_factor() {
    let profile = Profile::load("pmp-bench").unwrap();
    let text = format!("{}{}{}", wanted(1024, 4), lamp(), solid_walls());
    let mut renderer = Renderer::new(&profile, &scene(&text, Path::new("")), 1).unwrap();
    let found = bounced(&profile, &mut renderer, &shot(None));
    let truth = renderer.truth(&[]);
    // Along the image's middle row, by the trapezoid rule over the distance from the crease; the
    // ends as they are next to them.
    let mut profile_of: Vec<(f64, f64)> = on_walls(&profile, &truth)
        .into_iter()
        .filter(|(i, wall, _)| *wall == 0 && i / 1138 == 244)
        .map(|(i, _, point)| (OUT[0].dot(point - CREASE), found[i]))
        .collect();
    profile_of.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (first, last) = (profile_of[0], profile_of[profile_of.len() - 1]);
    assert!(first.0 < 3.0 && last.0 > WIDTH[0] - 3.0);
    let inner: f64 = profile_of
        .windows(2)
        .map(|w| (w[1].0 - w[0].0) * (w[0].1 + w[1].1) / 2.0)
        .sum();
    let ends = first.0 * first.1 + (WIDTH[0] - last.0) * last.1;
    let mean = (inner + ends) / WIDTH[0] / (ALBEDO[0] * ALBEDO[1]);
    // Hottel's crossed strings, for strips without end.
    let h = WIDTH[1] / WIDTH[0];
    let exact = (1.0 + h - (1.0 + h * h).sqrt()) / 2.0;
    assert!((mean / exact - 1.0).abs() < 0.01, "{mean} {exact}");
}

/// Inside of a sphere every place sees every other in proportion to its area, whatever the angles
/// (e.g. Howell, Menguc, Siegel, "Thermal Radiation Heat Transfer"): one bounce brings everywhere
/// the albedo times the mean irradiance, that of the lamp's whole power.
#[test]
fn inside_of_a_sphere_all_power_comes_back_evenly() {
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

/// The same with surfaces that absorb nothing, whatever their highlights take of it, and with a
/// fine chequered picture, of which each place has its own share.
#[test]
fn highlights_and_pictures_keep_the_energy() {
    let profile = Profile::load("pmp-bench").unwrap();
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
        // What each pixel makes of 0.5 W/m^2 from everywhere.
        let even = inside("ambient = { irradiance_w_m2 = 0.5 }\n").expected_dn(&shot(None));
        let (black, scale) = (4.0, dn_per_irradiance(&profile, 8e-3));
        let exact = mean_share * intensity * 1e6 / (radius * radius);
        let errors: Vec<f64> = found
            .iter()
            .zip(even)
            .filter(|(_, even)| *even > black + 10.0)
            .map(|(found, even)| found * 0.5 * scale / f64::from(even - black) / exact - 1.0)
            .collect();
        assert!(errors.len() > 200_000, "{}", errors.len());
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        assert!(
            rms(&errors) < bar && mean.abs() < bar / 5.0,
            "{look}: {} {mean}",
            rms(&errors)
        );
    }
}

fn fringe(profile: &Profile, axis: Axis, period_px: f64) -> Slide {
    let pattern = Pattern::Fringe {
        axis,
        period_px,
        phase_rad: 0.4,
    };
    Slide::new(&pattern, &profile.projector, &|_| unreachable!()).unwrap()
}

/// What the second wall throws on a point of the first under a row slide along x, in W/m^2: the
/// midpoint rule over the wall's lit part, in f64.
fn integrated(profile: &Profile, point: DVec3, levels: &[u16]) -> f64 {
    let view = profile.projector.view();
    let pupil = view.center();
    let (wide, high) = (800, 450);
    let (ds, dy) = (WIDTH[1] / f64::from(wide), 600.0 / f64::from(high));
    let mut sum = 0.0;
    for i in 0..wide {
        for j in 0..high {
            let q = CREASE
                + OUT[1] * ((f64::from(i) + 0.5) * ds)
                + DVec3::Y * ((f64::from(j) + 0.5) * dy - 300.0);
            let Some(px) = view.project(q).filter(|&px| view.lens.contains(px)) else {
                continue;
            };
            let level = f64::from(levels[px.x.round() as usize]) / 255.0;
            let (way, light) = (q - point, pupil - q);
            let (r2, d2) = (way.length_squared(), light.length_squared());
            // Each wall's direction is the other's normal.
            let cos_light = (OUT[0].dot(light) / d2.sqrt()).max(0.0);
            let irradiance = 1e6 * profile.projector.radiant_intensity_w_sr * cos_light / d2;
            let cosines = OUT[1].dot(way) * -OUT[0].dot(way) / r2;
            sum += level * irradiance * cosines / (PI * r2) * ds * dy;
        }
    }
    sum * ALBEDO[1]
}

#[test]
fn fringes_bounce_as_direct_integration_has_it() {
    let mut profile = Profile::load("pmp-bench").unwrap();
    profile.projector.radiant_intensity_w_sr = 0.5;
    for period in [16.0, 480.0] {
        let slide = fringe(&profile, Axis::X, period);
        let Slide::Row(_, levels) = &slide else {
            panic!("a fringe is a row");
        };
        let levels = levels.clone();
        let mut errors_of = Vec::new();
        for samples in [64, 1024] {
            let text = format!("{}{}", wanted(samples, 8), solid_walls());
            let mut renderer = Renderer::new(&profile, &scene(&text, Path::new("")), 1).unwrap();
            let found = bounced(&profile, &mut renderer, &shot(Some(slide.clone())));
            let truth = renderer.truth(&[]);
            let points: Vec<_> = on_walls(&profile, &truth)
                .into_iter()
                .filter(|(i, wall, _)| *wall == 0 && i % 1138 % 8 == 0 && i / 1138 % 96 == 0)
                .filter(|(_, _, p)| OUT[0].dot(*p - CREASE) > 10.0)
                .collect();
            assert!(points.len() > 25, "{}", points.len());
            let pairs: Vec<(f64, f64)> = points
                .par_iter()
                .map(|(i, _, p)| (found[*i] / ALBEDO[0], integrated(&profile, *p, &levels)))
                .collect();
            let peak = pairs.iter().fold(0.0f64, |m, (_, exact)| m.max(*exact));
            let errors: Vec<f64> = pairs.iter().map(|(f, e)| (f - e) / peak).collect();
            errors_of.push(rms(&errors));
        }
        assert!(errors_of[1] < 0.01 && errors_of[0] < 0.06, "{errors_of:?}");
    }
}

/// A sphere of longitudes and latitudes.
fn ball(center: DVec3, radius: f64, across: u32) -> Mesh {
    let (columns, rows) = (2 * across, across);
    let mut mesh = Mesh::default();
    for j in 0..=rows {
        for i in 0..columns {
            let lat = PI * f64::from(j) / f64::from(rows);
            let lon = TAU * f64::from(i) / f64::from(columns);
            let unit = DVec3::new(lat.sin() * lon.cos(), lat.cos(), lat.sin() * lon.sin());
            mesh.vertices.push(center + unit * radius);
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
fn nothing_bounces_where_nothing_is_concave() {
    let profile = Profile::load("pmp-bench").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let round = ball(DVec3::new(20.0, -10.0, 940.0), 75.0, 60);
    ply::write_mesh(&folder.path().join("ball.ply"), &round).unwrap();
    let mut sheet = Mesh::default();
    let corner = |k: i32| f64::from(k - 20) * 31.7;
    for k in 0..41 * 41 {
        let (x, y) = (corner(k % 41), corner(k / 41));
        sheet
            .vertices
            .push(DVec3::new(x, y, 1000.0 + 0.3 * x - 0.1 * y));
        if k % 41 < 40 && k / 41 < 40 {
            let k = k as u32;
            sheet
                .triangles
                .extend([[k, k + 1, k + 42], [k, k + 42, k + 41]]);
        }
    }
    ply::write_mesh(&folder.path().join("sheet.ply"), &sheet).unwrap();
    for shape in [
        "{ kind = \"plane\" }\nposition_mm = [0, 0, 1000]\nrotation_deg = [5, -8, 0]",
        "{ kind = \"sphere\", radius_mm = 75.0 }\nposition_mm = [0, 0, 940]",
        "{ kind = \"mesh\", file = \"ball.ply\" }",
        "{ kind = \"mesh\", file = \"sheet.ply\" }",
    ] {
        let text = format!(
            "{}[[light]]\nkind = \"point\"\nposition_mm = [-300, 200, 400]\n\
             intensity_w_sr = 0.12\n[[object]]\nshape = {shape}\nalbedo = 0.7\n",
            wanted(64, 4)
        );
        let scene = scene(&text, folder.path());
        let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
        let solid = !shape.contains("mesh");
        assert_ne!(renderer.plan().has(Term::Interreflection), solid, "{shape}");
        let shot = shot(Some(fringe(&profile, Axis::X, 16.0)));
        renderer.force(Term::Interreflection, true);
        let with = renderer.expose(&shot).data;
        let expected = renderer.expected_dn(&shot);
        renderer.force(Term::Interreflection, false);
        assert_eq!(expected, renderer.expected_dn(&shot), "{shape}");
        assert_eq!(with, renderer.expose(&shot).data, "{shape}");
    }
}

/// A box about a ball, in front of a wall: everything sees something.
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

#[test]
fn light_adds_up_and_no_more_comes_back_than_went_in() {
    let mut profile = Profile::load("pmp-bench").unwrap();
    profile.projector.radiant_intensity_w_sr = 0.4;
    let mut renderer = Renderer::new(&profile, &clutter(64, 4), 1).unwrap();
    let full = |level| Slide::Row(Axis::X, vec![level; 1920]);
    let inverse = |slide: &Slide| match slide {
        Slide::Row(axis, levels) => Slide::Row(*axis, levels.iter().map(|l| 255 - l).collect()),
        _ => panic!("a fringe is a row"),
    };
    let mut of = |slide: Slide| bounced(&profile, &mut renderer, &shot(Some(slide)));
    let (dark, uniform) = (of(full(0)), of(Slide::Uniform(255)));
    // Light at the nearest, 800 mm or so away, and what the lamp gives; albedo 0.85 at the most.
    let most = 0.85f64.powi(2) * (0.4e6 / 6.4e5 + 0.04e6 / 1e5);
    assert!(uniform.iter().all(|&e| (-1e-6..most).contains(&e)));
    assert!(uniform.iter().filter(|&&e| e > 0.01).count() > 50_000);
    for slide in [
        fringe(&profile, Axis::X, 16.0),
        fringe(&profile, Axis::Y, 40.0),
        full(255),
    ] {
        let (one, other) = (of(slide.clone()), of(inverse(&slide)));
        for i in 0..one.len() {
            let sum = one[i] + other[i] - dark[i];
            assert!((sum - uniform[i]).abs() < 1e-5, "{i}: {sum} {}", uniform[i]);
            assert!(one[i] > dark[i] - 1e-6 && one[i] < uniform[i] + 1e-6);
        }
    }
}

#[test]
fn pictures_bounce_like_the_rows_that_they_repeat() {
    let mut profile = Profile::load("pmp-bench").unwrap();
    profile.projector.radiant_intensity_w_sr = 0.4;
    let mut renderer = Renderer::new(&profile, &clutter(64, 4), 1).unwrap();
    for axis in [Axis::X, Axis::Y] {
        let slide = fringe(&profile, axis, 120.0);
        let Slide::Row(_, levels) = &slide else {
            panic!("a fringe is a row");
        };
        let level = |i: usize| match axis {
            Axis::X => levels[i % 1920],
            Axis::Y => levels[i / 1920],
        };
        let picture = Slide::Picture {
            width: 1920,
            height: 1080,
            levels: (0..1920 * 1080).map(level).collect(),
        };
        let one = bounced(&profile, &mut renderer, &shot(Some(slide.clone())));
        let other = bounced(&profile, &mut renderer, &shot(Some(picture)));
        let errors: Vec<f64> = one.iter().zip(&other).map(|(a, b)| a - b).collect();
        assert!(
            rms(&errors) < 0.01 * rms(&one),
            "{} {}",
            rms(&errors),
            rms(&one)
        );
    }
}

#[test]
fn coarser_grids_are_near_and_say_the_same_of_geometry() {
    let mut profile = Profile::load("pmp-bench").unwrap();
    profile.projector.radiant_intensity_w_sr = 0.4;
    let image = |step_px| {
        let mut renderer = Renderer::new(&profile, &clutter(16, step_px), 1).unwrap();
        let light = bounced(&profile, &mut renderer, &shot(Some(Slide::Uniform(255))));
        (light, renderer.truth(&[]))
    };
    let (fine, truth) = image(1);
    let mut plain = Renderer::new(&profile, &clutter(16, 1), 1).unwrap();
    plain.force(Term::Interreflection, false);
    let bare = plain.truth(&[]);
    let same = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits());
    assert_eq!(truth.flags, bare.flags);
    assert!(same(&truth.depth_mm, &bare.depth_mm));
    assert!(same(&truth.projector_x, &bare.projector_x));
    assert!(same(&truth.projector_y, &bare.projector_y));
    // What sixteen rays miss differs from point to point, so means of many tell.
    for (step, [relative, absolute]) in [(4, [0.01, 1e-4]), (16, [0.03, 5e-4])] {
        let (coarse, _) = image(step);
        for block in 0..9 {
            let (left, top) = (230 + block % 3 * 220, 20 + block / 3 * 150);
            let mean = |light: &[f64]| {
                let rows = top..top + 150;
                let sum: f64 = rows
                    .map(|v| light[v * 1138 + left..][..220].iter().sum::<f64>())
                    .sum();
                sum / (150.0 * 220.0)
            };
            let (a, b) = (mean(&fine), mean(&coarse));
            let bar = relative * a + absolute;
            assert!((a - b).abs() < bar, "{step} {block}: {a} {b}");
        }
    }
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let profile = Profile::load("pmp-bench").unwrap();
    let scene = clutter(16, 8);
    let render = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let mut renderer = Renderer::new(&profile, &scene, 42).unwrap();
            [Some(fringe(&profile, Axis::X, 16.0)), None]
                .map(|slide| renderer.expose(&shot(slide)).data)
        })
    };
    let one = render(1);
    assert_eq!(one, render(2));
    assert_eq!(one, render(3));
}
