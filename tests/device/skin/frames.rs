//! Frames of skin compared with closed forms.

use crate::skin::wall::{PLANE, Seen, bench, is_even, levels, pattern_image, shot, wall};
use glam::{DVec2, DVec3};
use phasmid::emulator::render::skin::{Mixture, Tissue};
use phasmid::emulator::render::{Options, Renderer, Term};
use phasmid::emulator::{PatternImage, Truth};
use phasmid::geometry::Pose;
use phasmid::pattern::{Axis, Pattern};
use phasmid::profile::{Focus, Profile};
use std::f64::consts::TAU;
use std::sync::Arc;

const SKIN: &str = "skin = { absorption_per_mm = 0.02, reduced_scattering_per_mm = 2.0 }\n";
const TISSUE: Tissue = Tissue {
    absorption_per_mm: 0.02,
    reduced_scattering_per_mm: 2.0,
    refractive_index: 1.4,
};

/// Returns the level at x of a periodic row of held pixels under a trapezoid and a transfer function
/// of the frequency in cycles per projector pixel, by its Fourier series. The transfer function must
/// decay fast enough for 40 harmonics per pixel.
fn series(row: &[f64], x: f64, slope: DVec2, transfer: impl Fn(f64) -> f64) -> f64 {
    let period = row.len() as f64;
    let sinc = |w: f64| {
        if w == 0.0 {
            1.0
        } else {
            (w * TAU / 2.0).sin() / (w * TAU / 2.0)
        }
    };
    let mut sum = row.iter().sum::<f64>() / period;
    for m in 1..=row.len() * 40 {
        let f = m as f64 / period;
        let left = sinc(f) * sinc(f * slope.x) * sinc(f * slope.y) * transfer(f);
        if left.abs() < 1e-7 {
            continue;
        }
        let held = |(i, level): (usize, &f64)| level * (TAU * f * (x - i as f64)).cos();
        sum += 2.0 / period * left * row.iter().enumerate().map(held).sum::<f64>();
    }
    sum
}

fn fringe(axis: Axis, period_px: f64) -> Pattern {
    Pattern::Fringe {
        axis,
        period_px,
        phase_rad: 0.7,
    }
}

fn gray() -> Pattern {
    Pattern::Gray {
        axis: Axis::X,
        cell_px: 8.0,
        bits: 8,
        bit: 0,
        inverted: false,
    }
}

#[test]
fn fringes_and_gray_code_go_through_one_transfer() {
    let mixture = Mixture::new(&TISSUE);
    let mut soft = bench();
    soft.projector.focus = Some(Focus {
        distance_mm: 850.0,
        aperture_mm: 6.0,
    });
    let mut distorted = bench();
    distorted.camera.distortion = [-0.12, 0.05, 8e-4, -5e-4, -0.004];
    distorted.projector.distortion = [-0.05, 0.02, -4e-4, 6e-4, 0.001];
    for (profile, rotation) in [
        (bench(), [0.0; 3]),
        (bench(), [10.0, 35.0, 0.0]),
        (soft, [5.0, -20.0, 0.0]),
        (distorted, [0.0, 20.0, 0.0]),
    ] {
        let scene = wall(rotation, &format!("{PLANE}{SKIN}"));
        let normal = Pose::from_xyz_deg(DVec3::ZERO, DVec3::from(rotation)).direction(DVec3::Z);
        let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
        let truth = renderer.truth(&[]);
        for (pattern, period) in [
            (fringe(Axis::X, 16.0), 16),
            (fringe(Axis::X, 6.0), 6),
            (gray(), 32),
        ] {
            let pattern_image = pattern_image(&pattern, &profile);
            let PatternImage::Row(_, row) = &*pattern_image else {
                panic!("a row")
            };
            let row: Vec<_> = row[..period]
                .iter()
                .map(|&l| f64::from(l) / 255.0)
                .collect();
            let found = levels(&mut renderer, &profile, &pattern_image);
            let (mut count, mut worst, mut theory) = (0, 0.0f64, 0.0f64);
            for i in (0..found.len())
                .step_by(661)
                .filter(|&i| is_even(&truth, i))
            {
                let px = DVec2::new((i % 1138) as f64, (i / 1138) as f64);
                let seen = Seen::new(&profile, normal, px);
                assert!((seen.x - f64::from(truth.projector_x[i])).abs() < 2e-3);
                // Stay a few scattering lengths away from the ends of the pattern image.
                if !(100.0..1820.0).contains(&seen.x) {
                    continue;
                }
                let shift_mm = seen.along / 1.4 / (0.35 * 0.02 + 2.0);
                let from = seen.x - seen.gradient.dot(shift_mm);
                let scale = seen.gradient.length();
                let defocus = profile.projector.focus.map_or(0.0, |focus| {
                    let disc = focus.aperture_mm * (seen.depth / focus.distance_mm - 1.0).abs();
                    disc / seen.depth * 1.433 * 1920.0 / 4.0
                });
                let soft = |f: f64| (-2.0 * (TAU / 2.0 * defocus * f).powi(2)).exp();
                let level = |of: &dyn Fn(f64) -> f64| {
                    series(&row, from, seen.slope, |f| soft(f) * of(TAU * f * scale))
                };
                let fitted = level(&|k| mixture.transfer(k));
                let exact = level(&|k| TISSUE.transfer(k));
                worst = worst.max(255.0 * (found[i] - fitted).abs());
                theory = theory.max(255.0 * (found[i] - exact).abs());
                count += 1;
            }
            println!("{pattern:?} {rotation:?}: {count} pixels, {worst:.3} {theory:.3}");
            assert!(count > 100, "{count}");
            assert!(worst < 0.05, "{pattern:?} {rotation:?}: {worst}");
            // This bounds the difference between the mixture of Gaussians and the published curve.
            assert!(theory < 0.5, "{pattern:?} {rotation:?}: {theory}");
        }
    }
}

#[test]
fn an_edge_of_skin_has_the_levels_of_its_inside() {
    // A horizontal edge, so that patterns along x look the same in all pixels that it crosses.
    let profile = bench();
    // The edge crosses a pixel between two rows of its sample grid: a quarter of a pixel below its
    // centre.
    let lens = profile.camera.view().lens;
    let edge = (lens.principal_px.y - 190.25) * 1000.0 / lens.focal_px.y;
    let size = [400.0, 2.0 * edge];
    let shape = format!("shape = {{ kind = \"plane\", size_mm = {size:?} }}\nalbedo = 0.9\n");
    for side in [1, 16] {
        let options = Options {
            samples: side,
            ..Options::default()
        };
        let scene = wall([0.0; 3], &format!("{shape}{SKIN}"));
        let mut renderer = Renderer::with_options(&profile, &scene, 1, options).unwrap();
        let pattern = fringe(Axis::X, 96.0);
        let found = levels(&mut renderer, &profile, &pattern_image(&pattern, &profile));
        let truth = renderer.truth(&[]);
        let (mut count, mut worst) = (0, 0.0f64);
        for i in 0..found.len() - 1139 {
            let (edge, inside) = (truth.flags[i], truth.flags[i + 1138]);
            let cut = edge & Truth::CREASE != 0;
            let whole = Truth::LIT | Truth::CREASE;
            let x = truth.projector_x[i + 1138];
            if cut && inside & whole == Truth::LIT && (100.0..1820.0).contains(&x) {
                // On average, the four samples below the edge are 3/32 of a pixel to the side of
                // the pixel's centre.
                let (here, next) = (found[i + 1138], found[i + 1139]);
                let expected = here + (next - here) * 3.0 / 32.0;
                worst = worst.max(255.0 * (found[i] - expected).abs());
                count += 1;
            }
        }
        println!("{count} {worst}");
        assert!(count > 100, "{count}");
        assert!(worst < 0.7, "{side}: {worst}");
    }
}

#[test]
fn an_image_of_fringes_is_close_to_fringes() {
    let profile = bench();
    let scene = wall([0.0, 20.0, 0.0], &format!("{PLANE}{SKIN}"));
    let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
    for pattern in [fringe(Axis::X, 16.0), fringe(Axis::Y, 24.0), gray()] {
        let row = pattern_image(&pattern, &profile);
        let PatternImage::Row(axis, levels_of) = &*row else {
            panic!("a row")
        };
        let along = |i: usize| match axis {
            Axis::X => i % 1920,
            Axis::Y => i / 1920,
        };
        let image = Arc::new(PatternImage::Image {
            width: 1920,
            height: 1080,
            levels: (0..1920 * 1080).map(|i| levels_of[along(i)]).collect(),
        });
        let flat = levels(&mut renderer, &profile, &row);
        let drawn = levels(&mut renderer, &profile, &image);
        let truth = renderer.truth(&[]);
        let inside = |i: &usize| {
            is_even(&truth, *i)
                && (100.0..1820.0).contains(&truth.projector_x[*i])
                && (100.0..980.0).contains(&truth.projector_y[*i])
        };
        let worst = (0..flat.len())
            .filter(inside)
            .map(|i| 255.0 * (flat[i] - drawn[i]).abs())
            .fold(0.0, f64::max);
        println!("{pattern:?}: {worst}");
        assert!(worst > 0.0 && worst < 7.0, "{pattern:?}: {worst}");
    }
}

fn modulation(profile: &Profile, lines: &str, period: f64) -> Truth {
    let scene = wall([0.0; 3], lines);
    let mut renderer = Renderer::new(profile, &scene, 1).unwrap();
    let sequence: Vec<_> = (0..4)
        .map(|i| {
            let pattern = Pattern::Fringe {
                axis: Axis::X,
                period_px: period,
                phase_rad: TAU * f64::from(i) / 4.0,
            };
            let shot = shot(&pattern_image(&pattern, profile));
            (pattern, shot)
        })
        .collect();
    renderer.truth(&sequence)
}

#[test]
fn truth_is_that_of_the_surface_and_says_where_skin_swallows_fringes() {
    let profile = bench();
    let sharp = modulation(&profile, PLANE, 16.0);
    let skin = modulation(&profile, &format!("{PLANE}{SKIN}"), 16.0);
    let same = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits());
    assert!(same(&sharp.projector_x, &skin.projector_x) && same(&sharp.depth_mm, &skin.depth_mm));
    assert_eq!(sharp.flags, skin.flags);
    // The ratio of modulations is R(0) times the transfer at 0.172 cycles a millimetre.
    let middle = 244 * 1138 + 569;
    let mean = |truth: &Truth| {
        truth.modulation_dn[middle - 40..middle + 40]
            .iter()
            .sum::<f32>()
    };
    let ratio = f64::from(mean(&skin) / mean(&sharp));
    let expected = TISSUE.reflectance(TAU * 1.433 * 1920.0 / 1000.0 / 16.0);
    assert!((ratio / expected - 1.0).abs() < 0.01, "{ratio} {expected}");
    // This tissue preserves less than a twentieth of the modulation, so the flag for unresolved
    // fringes must be set.
    let milk = "skin = { absorption_per_mm = 0.002, reduced_scattering_per_mm = 0.3 }\n";
    let lost = modulation(&profile, &format!("{PLANE}{milk}"), 16.0);
    assert!(lost.flags[middle] & Truth::UNRESOLVED != 0);
}

#[test]
fn opaque_skin_is_a_lambertian_surface() {
    let profile = bench();
    let tissue = Tissue {
        absorption_per_mm: 10.0,
        reduced_scattering_per_mm: 1e4,
        refractive_index: 1.4,
    };
    let skin = "skin = { absorption_per_mm = 10, reduced_scattering_per_mm = 10000 }\n";
    let opaque = wall([0.0, 30.0, 0.0], &format!("{PLANE}{skin}"));
    let albedo = 0.9 * tissue.reflectance(0.0);
    let plain = PLANE.replace("0.9", &format!("{albedo:?}"));
    let plain = wall([0.0, 30.0, 0.0], &plain);
    let mut renderers = [opaque, plain].map(|s| Renderer::new(&profile, &s, 1).unwrap());
    assert!(renderers[0].plan().has(Term::Subsurface));
    assert!(!renderers[1].plan().has(Term::Subsurface));
    for pattern in [Pattern::White {}, fringe(Axis::X, 16.0), gray()] {
        let pattern_image = pattern_image(&pattern, &profile);
        let [a, b] = renderers
            .each_mut()
            .map(|r| r.expected_dn(&shot(&pattern_image)));
        let worst = a
            .iter()
            .zip(&b)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f32::max);
        assert!(worst < 0.05, "{pattern:?}: {worst}");
    }
    // Without the term, any skin is Lambertian.
    let scene = wall([0.0; 3], &format!("{PLANE}{SKIN}"));
    let plain = PLANE.replace("0.9", &format!("{:?}", 0.9 * TISSUE.reflectance(0.0)));
    let mut left_out = Renderer::new(&profile, &scene, 1).unwrap();
    left_out.force(Term::Subsurface, false);
    let mut plain = Renderer::new(&profile, &wall([0.0; 3], &plain), 1).unwrap();
    let shot = shot(&pattern_image(&gray(), &profile));
    assert!(left_out.expose(&shot).data == plain.expose(&shot).data);
}
