//! Projected pattern images compared with direct integration.

use crate::interreflection::*;
use crate::photometry::scene;
use glam::DVec3;
use phasmid::emulator::PatternImage;
use phasmid::emulator::render::Renderer;
use phasmid::pattern::Axis;
use phasmid::profile::Profile;
use rayon::prelude::*;
use std::f64::consts::PI;
use std::path::Path;

/// Returns the irradiance in W/m^2 at a point of the first wall that is caused by the second wall,
/// which a row pattern image along x lights. Integrates over the lit part of the second wall by the
/// midpoint rule, in f64.
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
            // The direction of each wall is the normal of the other.
            let cos_light = (OUT[0].dot(light) / d2.sqrt()).max(0.0);
            let irradiance = 1e6 * profile.projector.radiant_intensity_w_sr * cos_light / d2;
            let cosines = OUT[1].dot(way) * -OUT[0].dot(way) / r2;
            sum += level * irradiance * cosines / (PI * r2) * ds * dy;
        }
    }
    sum * ALBEDO[1]
}

#[test]
fn bounced_fringes_match_direct_integration() {
    let mut profile = Profile::load("pmp-bench").unwrap();
    profile.projector.radiant_intensity_w_sr = 0.5;
    for period in [16.0, 480.0] {
        let pattern_image = fringe(&profile, Axis::X, period);
        let PatternImage::Row(_, levels) = &pattern_image else {
            panic!("a fringe is a row");
        };
        let levels = levels.clone();
        let mut errors_of = Vec::new();
        for samples in [64, 1024] {
            let text = format!("{}{}", wanted(samples, 8), solid_walls());
            let mut renderer = Renderer::new(&profile, &scene(&text, Path::new("")), 1).unwrap();
            let found = bounced(&profile, &mut renderer, &shot(Some(pattern_image.clone())));
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
#[test]
fn images_bounce_like_the_rows_that_they_repeat() {
    let mut profile = Profile::load("pmp-bench").unwrap();
    profile.projector.radiant_intensity_w_sr = 0.4;
    let mut renderer = Renderer::new(&profile, &clutter(64, 4), 1).unwrap();
    for axis in [Axis::X, Axis::Y] {
        let pattern_image = fringe(&profile, axis, 120.0);
        let PatternImage::Row(_, levels) = &pattern_image else {
            panic!("a fringe is a row");
        };
        let level = |i: usize| match axis {
            Axis::X => levels[i % 1920],
            Axis::Y => levels[i / 1920],
        };
        let image = PatternImage::Image {
            width: 1920,
            height: 1080,
            levels: (0..1920 * 1080).map(level).collect(),
        };
        let one = bounced(&profile, &mut renderer, &shot(Some(pattern_image.clone())));
        let other = bounced(&profile, &mut renderer, &shot(Some(image)));
        let errors: Vec<f64> = one.iter().zip(&other).map(|(a, b)| a - b).collect();
        assert!(
            rms(&errors) < 0.01 * rms(&one),
            "{} {}",
            rms(&errors),
            rms(&one)
        );
    }
}
