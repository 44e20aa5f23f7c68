//! A pixel's fringe order is right, or the pixel is masked.

use crate::decode::patterns::*;
use crate::decode::scene::*;
use phasmid::decode::{Decoder, Options};
use phasmid::geometry::NoiseModel;
use phasmid::pattern::{Axis, Image};

#[test]
fn decoding_is_exact_at_wraps_and_code_edges() {
    // 16-bit samples without noise, positions at and next to multiples of half a period.
    let positions: Vec<[f64; 2]> = (0..WIDTH)
        .flat_map(|u| [-0.5, -1e-3, -1e-6, 0.0, 1e-6, 1e-3, 0.5].map(|d| [8.0 + 7.4 * u as f64, d]))
        .map(|[x, d]| [(x / 8.0).round() * 8.0 + d, 0.0])
        .collect();
    let scene = Scene {
        floor: 2000.0,
        swing: 60000.0,
        noise: 0.0,
        ..Scene::default()
    };
    for code in [
        gray(Axis::X, 8.0, 0..8, false),
        gray(Axis::X, 8.0, 0..8, true),
        [
            gray(Axis::X, 16.0, 0..7, false),
            gray(Axis::X, 8.0, 0..1, false),
        ]
        .concat(),
        gray(Axis::X, 16.0, 0..7, false),
    ] {
        let manifest = manifest([equal(Axis::X, 16.0, 12), code, references()].concat());
        let frames: Vec<Vec<u16>> = manifest
            .frame
            .iter()
            .map(|f| scene.frame(0, &f.pattern, &positions))
            .map(|f| f.iter().map(|v| v.round() as u16).collect())
            .collect();
        let options = Options {
            keep_mixed: true,
            noise: Some(NoiseModel {
                saturation_dn: 65535.0,
                ..scene.noise_model()
            }),
            ..Options::default()
        };
        let decoder = Decoder::new(&manifest, WIDTH, 7, None, options).unwrap();
        let images: Vec<_> = frames
            .iter()
            .map(|f| Image::new(WIDTH, 7, f.clone()).unwrap())
            .collect();
        let decoded = decoder.decode(&images).unwrap();
        let f = figures(&decoded, Axis::X, &positions, 1e-3);
        assert!(f.gross == 0.0 && f.coverage == 1.0, "{f:?}");
    }
}

#[test]
fn every_kind_of_sequence_gives_the_right_order() {
    let positions = sweep(64);
    let third = 200.0 / 3.0;
    for (name, patterns) in [
        (
            "complements",
            [equal(Axis::X, 16.0, 4), gray(Axis::X, 8.0, 0..8, true)].concat(),
        ),
        (
            "plain code as wide as the period",
            [
                equal(Axis::X, 16.0, 4),
                gray(Axis::X, 16.0, 0..7, false),
                references(),
            ]
            .concat(),
        ),
        (
            "complementary code",
            [
                equal(Axis::X, 16.0, 12),
                gray(Axis::X, 16.0, 0..7, false),
                gray(Axis::X, 8.0, 0..1, false),
                references(),
            ]
            .concat(),
        ),
        (
            "threshold from the fringes",
            [equal(Axis::X, 16.0, 4), gray(Axis::X, 8.0, 0..8, false)].concat(),
        ),
        (
            "complements only",
            [
                equal(Axis::X, 16.0, 4),
                gray(Axis::X, 8.0, 0..8, true)
                    .into_iter()
                    .skip(1)
                    .step_by(2)
                    .collect(),
                references(),
            ]
            .concat(),
        ),
        (
            "heterodyne",
            [
                equal(Axis::X, 64.0, 4),
                equal(Axis::X, 70.0, 4),
                equal(Axis::X, 59.0, 4),
            ]
            .concat(),
        ),
        (
            "coarse to fine",
            [
                equal(Axis::X, 24.0, 4),
                equal(Axis::X, 200.0, 4),
                equal(Axis::X, 2000.0, 4),
            ]
            .concat(),
        ),
        (
            "beat and code",
            [
                equal(Axis::X, third, 3),
                equal(Axis::X, 100.0, 3),
                gray(Axis::X, 100.0, 0..5, true),
            ]
            .concat(),
        ),
        ("one period over all", equal(Axis::X, 2000.0, 8)),
    ] {
        let scene = Scene {
            noise: 0.7,
            ..Scene::default()
        };
        let decoded = scene.decode(&manifest(patterns), &positions, scene.options());
        let f = figures(&decoded, Axis::X, &positions, 8.0);
        assert!(f.gross == 0.0, "{name}: {f:?}");
        assert!(f.coverage > 0.99, "{name}: {f:?} {:?}", counts(&decoded));
        assert!((f.ratio - 1.0).abs() < 0.05, "{name}: {f:?}");
    }
}

#[test]
fn decodes_both_axes_and_gray_code_alone() {
    let positions = sweep(64);
    let scene = Scene::default();
    let both = [
        equal(Axis::X, 16.0, 4),
        gray(Axis::X, 8.0, 0..8, true),
        equal(Axis::Y, 20.0, 5),
        gray(Axis::Y, 10.0, 0..7, true),
    ]
    .concat();
    let decoded = scene.decode(&manifest(both), &positions, scene.options());
    for axis in [Axis::X, Axis::Y] {
        let f = figures(&decoded, axis, &positions, 4.0);
        assert!(f.gross == 0.0 && f.coverage > 0.99, "{axis} {f:?}");
        assert!((f.ratio - 1.0).abs() < 0.05, "{axis} {f:?}");
    }
    let code = [gray(Axis::X, 8.0, 0..8, false), references()].concat();
    let options = Options {
        keep_mixed: true,
        ..scene.options()
    };
    let decoded = scene.decode(&manifest(code), &positions, options);
    let f = figures(&decoded, Axis::X, &positions, 4.6);
    assert!(f.gross == 0.0 && f.coverage > 0.99, "{f:?}");
    // The position is uniform within a cell: sigma is cell / sqrt(12), or less where an edge is
    // seen.
    assert!((f.sigma - 8.0 / 12.0f64.sqrt()).abs() < 1e-3 && f.ratio < 1.0 && f.ratio > 0.7);
}

#[test]
fn at_high_noise_orders_are_masked_rather_than_wrong() {
    let positions = sweep(120);
    for (name, patterns) in [
        (
            "complementary code",
            [
                equal(Axis::X, 16.0, 12),
                gray(Axis::X, 16.0, 0..7, false),
                gray(Axis::X, 8.0, 0..1, false),
                references(),
            ]
            .concat(),
        ),
        (
            "plain code",
            [
                equal(Axis::X, 16.0, 12),
                gray(Axis::X, 16.0, 0..7, false),
                references(),
            ]
            .concat(),
        ),
        (
            "three periods",
            [
                equal(Axis::X, 30.0, 4),
                equal(Axis::X, 170.0, 4),
                equal(Axis::X, 2000.0, 4),
            ]
            .concat(),
        ),
        (
            "beat and code",
            [
                equal(Axis::X, 200.0 / 3.0, 3),
                equal(Axis::X, 100.0, 3),
                gray(Axis::X, 100.0, 0..5, true),
            ]
            .concat(),
        ),
    ] {
        let manifest = manifest(patterns);
        let mut covered: f64 = 0.0;
        // The ratio of modulation to noise falls from 20 to 2.5.
        for (seed, noise) in [(1, 2.0), (2, 4.0), (3, 6.0), (4, 9.0), (5, 16.0)] {
            let scene = Scene {
                floor: 60.0,
                swing: 80.0,
                noise,
                seed,
                ..Scene::default()
            };
            // Leave out the tests for mixed pixels, which depend on a pixel's neighbours.
            let options = Options {
                keep_mixed: true,
                ..scene.options()
            };
            let decoded = scene.decode(&manifest, &positions, options);
            let f = figures(&decoded, Axis::X, &positions, 8.0);
            println!("{name} {noise}: {f:?}");
            assert!(f.gross <= 1e-4, "{name} at {noise}: {f:?}");
            covered = covered.max(f.coverage);
        }
        assert!(covered > 0.95, "{name}: {covered}");
    }
}

#[test]
fn a_lone_period_is_wrapped_or_unwrapped_along_space() {
    // Neighbouring pixels differ by far less than half a period.
    let positions: Vec<[f64; 2]> = (0..WIDTH * 64)
        .map(|i| {
            [
                200.0 + 2.3 * (i % WIDTH) as f64 + 0.9 * (i / WIDTH) as f64,
                0.0,
            ]
        })
        .collect();
    let scene = Scene::default();
    let manifest = manifest(equal(Axis::X, 16.0, 8));
    let wrapped = scene.decode(&manifest, &positions, scene.options());
    let options = Options {
        unwrap_spatial: true,
        ..scene.options()
    };
    let unwrapped = scene.decode(&manifest, &positions, options);
    let (w, s) = (wrapped.x.as_ref().unwrap(), unwrapped.x.as_ref().unwrap());
    assert_eq!((w.wrapped_px, s.wrapped_px), (Some(16.0), Some(16.0)));
    let says = |decoded: &phasmid::decode::Decoded, what: &str| {
        decoded.notes.iter().any(|note| note.contains(what))
    };
    let known = "axis x is known modulo 16 px only";
    assert!(says(&wrapped, known), "{:?}", wrapped.notes);
    assert!(!says(&unwrapped, known) && says(&unwrapped, "spatially"));
    let first = (0..positions.len()).find(|&i| s.coordinate[i].is_finite());
    let first = first.unwrap();
    let shift = ((f64::from(s.coordinate[first]) - positions[first][0]) / 16.0).round() * 16.0;
    let mut refused = 0;
    for (i, p) in positions.iter().enumerate() {
        let (a, b) = (f64::from(w.coordinate[i]), f64::from(s.coordinate[i]));
        if a.is_nan() {
            // A pixel whose noise resembles a damaged frame is masked.
            refused += 1;
            continue;
        }
        assert!((0.0..16.0).contains(&a));
        assert!(((a - p[0] + 8.0).rem_euclid(16.0) - 8.0).abs() < 0.3);
        assert!((b - p[0] - shift).abs() < 0.3, "{i}");
    }
    assert!(refused * 1000 <= positions.len(), "{refused}");
}
