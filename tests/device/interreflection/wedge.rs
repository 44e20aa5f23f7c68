//! A right-angled wedge compared with form factors.

use crate::interreflection::*;
use crate::photometry::scene;
use glam::DVec3;
use phasmid::emulator::render::{Renderer, Term};
use phasmid::emulator::{Shot, Shutter};
use phasmid::profile::Profile;
use std::f64::consts::TAU;
use std::path::Path;

/// Returns the form factor between a point of the first wall and the second wall: the sum of the
/// form factors between an element and two rectangles perpendicular to it, each with a corner
/// opposite the element (Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", B-5).
fn wedge_factor(point: DVec3) -> f64 {
    let d = OUT[0].dot(point - CREASE);
    let far = d.hypot(WIDTH[1]);
    let corner = |b: f64| ((b / d).atan() - d / far * (b / far).atan()) / TAU;
    corner(LENGTH / 2.0 - point.y) + corner(LENGTH / 2.0 + point.y)
}

/// Returns the errors of the renderer in the wedge, in units of form factors. The wedge is scaled
/// about the camera and lit by the lamp.
fn wedge_errors(walls: &str, folder: &Path, samples: u32, scale: f64) -> Vec<f64> {
    let profile = Profile::load("pmp-bench").unwrap();
    let text = format!("{}{}{walls}", wanted(samples, 8), lamp());
    let mut renderer = Renderer::new(&profile, &scene(&text, folder), 1).unwrap();
    let found = bounced(&profile, &mut renderer, &shot(None));
    let truth = renderer.truth(&[]);
    let mut errors = Vec::new();
    for (i, wall, point) in on_walls(&profile, &truth) {
        if wall == 1 {
            // The first wall is dark, so it reflects nothing back.
            assert!(found[i].abs() < 1e-6, "{i}: {}", found[i]);
        } else if i % 1138 % 8 == 0 && i / 1138 % 8 == 0 {
            errors.push(found[i] / (ALBEDO[0] * ALBEDO[1]) - wedge_factor(point / scale));
        }
    }
    // Rounding decides whether light parallel to the first wall lights that wall, so the wall's
    // edges are excluded.
    assert!(errors.len() > 500, "{}", errors.len());
    errors
}
#[test]
fn a_right_angled_wedge_has_the_form_factors_profile() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = |scale| (mesh_walls(folder.path(), scale), scale);
    // After scaling, the meshes are about 50 mm and 100 m away.
    for (walls, scale) in [(solid_walls(), 1.0), mesh(1.0), mesh(0.05), mesh(100.0)] {
        let of = |samples| wedge_errors(&walls, folder.path(), samples, scale);
        let (few, many) = (of(64), of(1024));
        let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len() as f64;
        let worst = many.iter().fold(0.0f64, |w, e| w.max(e.abs()));
        // The other wall covers at most half of a point's hemisphere.
        assert!(rms(&many) < 0.0025 && worst < 0.01);
        assert!(mean(&many).abs() < 5e-4 && mean(&few).abs() < 2e-3);
        assert!(rms(&few) > 4.0 * rms(&many), "errors fall with the samples");
    }
}

/// Under a rolling shutter, each row sees moving walls at its own time. The light between the walls
/// equals the light between still walls, because the walls do not move relative to each other.
#[test]
fn walls_that_move_while_rows_start_bounce_as_still_ones_do() {
    let profile = Profile::load("pmp-bench").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let walls = mesh_walls(folder.path(), 1.0);
    // The walls move towards the camera by 1.5 mm between the starts of the first and the last row.
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
    // Integrate along the image's central row, by the trapezoidal rule over the distance from the
    // crease; the ends are extrapolated with the nearest value.
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
    // Hottel's crossed-strings method, for infinitely long strips.
    let h = WIDTH[1] / WIDTH[0];
    let exact = (1.0 + h - (1.0 + h * h).sqrt()) / 2.0;
    assert!((mean / exact - 1.0).abs() < 0.01, "{mean} {exact}");
}
