//! Errors have the size that the noise of the samples predicts, and the decoder estimates this
//! noise.

use crate::decode::patterns::*;
use crate::decode::scene::*;
use phasmid::decode::{Decoded, Decoder, Options};
use phasmid::geometry::NoiseModel;
use phasmid::pattern::{Axis, Image, Manifest, Pattern};
use std::f64::consts::TAU;

#[test]
fn phase_noise_reaches_the_bound() {
    let scene = Scene::default();
    let positions = sweep(128);
    let deviation = (scene.noise.powi(2) + 1.0 / 12.0).sqrt();
    let unequal = [0.0, 0.4, 1.3, 2.9, 3.3, 5.1];
    let sets = [3, 4, 5, 12].map(|n| (Some(n), equal(Axis::X, 16.0, n)));
    for (n, set) in sets
        .into_iter()
        .chain([(None, fringes(Axis::X, 16.0, &unequal))])
    {
        let manifest = manifest([set, gray(Axis::X, 8.0, 0..8, true)].concat());
        let options = Options {
            keep_mixed: true,
            ..scene.options()
        };
        let decoded = scene.decode(&manifest, &positions, options);
        let f = figures(&decoded, Axis::X, &positions, 4.0);
        assert!(f.gross == 0.0 && f.coverage > 0.999, "{n:?} {f:?}");
        assert!((f.ratio - 1.0).abs() < 0.03, "{n:?} {f:?}");
        if let Some(n) = n {
            let bound = 16.0 / TAU * (2.0 / n as f64).sqrt() * deviation / (0.5 * scene.swing);
            assert!((f.rms / bound - 1.0).abs() < 0.03, "{n} {f:?} {bound}");
            assert!((f.sigma / bound - 1.0).abs() < 0.01, "{n} {f:?} {bound}");
        }
    }
}

/// Returns 16-bit frames with a hundred DN per grey level, whose noise at intensity I has the
/// variance 0.5 + 0.05 I in grey levels, and that noise model.
fn with_shot_noise(manifest: &Manifest, positions: &[[f64; 2]]) -> (Vec<Vec<u16>>, NoiseModel) {
    let scene = Scene {
        noise: 0.0,
        ..Scene::default()
    };
    let frames = (0..manifest.frame.len())
        .map(|k| {
            let clean = scene.frame(k, &manifest.frame[k].pattern, positions);
            clean
                .iter()
                .enumerate()
                .map(|(i, v)| {
                    let sigma = (0.5 + 0.05 * v).sqrt();
                    let noisy = v + sigma * normal((k as u64) << 32 | i as u64);
                    // Sixteen bits make rounding negligible.
                    (100.0 * noisy).round().clamp(0.0, 65535.0) as u16
                })
                .collect()
        })
        .collect();
    let noise = NoiseModel {
        gain_dn_per_e: 5.0,
        read_noise_dn: 5000.0f64.sqrt(),
        black_level_dn: 0.0,
        saturation_dn: 65535.0,
    };
    (frames, noise)
}

fn decoded_16(manifest: &Manifest, frames: &[Vec<u16>], options: Options) -> Decoded {
    let height = frames[0].len() / WIDTH;
    let decoder = Decoder::new(manifest, WIDTH, height, None, options).unwrap();
    let images: Vec<_> = frames
        .iter()
        .map(|f| Image::new(WIDTH, height, f.clone()).unwrap())
        .collect();
    decoder.decode(&images).unwrap()
}

#[test]
fn shot_noise_is_carried_pixel_by_pixel_even_with_three_steps() {
    let positions = sweep(128);
    let manifest = manifest([equal(Axis::X, 16.0, 3), gray(Axis::X, 8.0, 0..8, true)].concat());
    let (frames, noise) = with_shot_noise(&manifest, &positions);
    let options = Options {
        noise: Some(noise),
        keep_mixed: true,
        ..Options::default()
    };
    let decoded = decoded_16(&manifest, &frames, options);
    // Errors are evaluated by thirds of the period, which would reveal a third harmonic.
    for third in 0..3 {
        let here: Vec<usize> = (0..positions.len())
            .filter(|&i| (positions[i][0] / 16.0 * 9.0).rem_euclid(3.0).floor() as i32 == third)
            .collect();
        let mut squares = 0.0;
        for &i in &here {
            let map = decoded.x.as_ref().unwrap();
            let error = f64::from(map.coordinate[i]) - positions[i][0];
            squares += (error / f64::from(map.sigma[i])).powi(2) / here.len() as f64;
        }
        assert!(
            (squares.sqrt() - 1.0).abs() < 0.03,
            "{third}: {}",
            squares.sqrt()
        );
    }
}

/// If the noise variance varies between the steps with the relative amplitude m, weights reduce
/// errors by a factor of sqrt(1 - t^2 / (1 - t^2)) with t = m / 2 for eight or more steps, by sqrt(1
/// - t^2) for six, and not at all for three. The stated errors shrink accordingly.
#[test]
fn weights_make_use_of_shot_noise() {
    let positions = sweep(128);
    // Mean 110 and modulation 90 grey levels.
    let t: f64 = 0.5 * 0.05 * 90.0 / (0.5 + 0.05 * 110.0);
    let most = 1.0 - t * t / (1.0 - t * t);
    for (n, share) in [(3, 1.0), (6, 1.0 - t * t), (8, most), (12, most)] {
        let manifest = manifest([equal(Axis::X, 16.0, n), gray(Axis::X, 8.0, 0..8, true)].concat());
        let (frames, noise) = with_shot_noise(&manifest, &positions);
        let [plain, weighted] = [false, true].map(|weighted| {
            let options = Options {
                weighted,
                noise: Some(noise),
                keep_mixed: true,
                ..Options::default()
            };
            let decoded = decoded_16(&manifest, &frames, options);
            let says = decoded
                .notes
                .iter()
                .any(|note| note.contains("have equal weight"));
            assert_eq!(says, weighted && n == 3, "{n} {:?}", decoded.notes);
            figures(&decoded, Axis::X, &positions, 4.0)
        });
        assert!(
            weighted.gross == 0.0 && weighted.coverage > 0.999,
            "{n} {weighted:?}"
        );
        assert!((weighted.ratio - 1.0).abs() < 0.02, "{n} {weighted:?}");
        let found = weighted.rms / plain.rms;
        assert!(
            (found / share.sqrt() - 1.0).abs() < 0.02,
            "{n} {found} {}",
            share.sqrt()
        );
    }
}

#[test]
fn noise_is_estimated_from_redundancy() {
    let positions = sweep(200);
    let estimate = |patterns: Vec<Pattern>, noise: f64| {
        let scene = Scene {
            noise,
            ..Scene::default()
        };
        let decoded = scene.decode(&manifest(patterns), &positions, Options::default());
        let f = figures(&decoded, Axis::X, &positions, 8.0);
        (decoded.noise.unwrap(), f, decoded.notes)
    };
    for noise in [0.5, 1.5, 4.0] {
        let truth = noise * noise + 1.0 / 12.0;
        for patterns in [
            [equal(Axis::X, 16.0, 3), gray(Axis::X, 8.0, 0..8, true)].concat(),
            [
                equal(Axis::X, 16.0, 12),
                gray(Axis::X, 8.0, 0..8, false),
                references(),
            ]
            .concat(),
        ] {
            let (model, f, _) = estimate(patterns, noise);
            let found = model.variance_dn2(110.0);
            assert!((found / truth - 1.0).abs() < 0.1, "{found} {truth}");
            assert!((f.ratio - 1.0).abs() < 0.06, "{f:?}");
        }
    }
    // The noise cannot be estimated from three steps and a Gray code without complements; a note
    // reports this.
    let (_, _, notes) = estimate(
        [
            equal(Axis::X, 16.0, 3),
            gray(Axis::X, 8.0, 0..8, false),
            references(),
        ]
        .concat(),
        1.0,
    );
    assert!(
        notes.iter().any(|n| n.contains("1 DN is assumed")),
        "{notes:?}"
    );
}

/// Five of six pixels are unlit and always round to one value, so the noise must be estimated from
/// the others alone. Tested with 8 bits, and with 8 bits stretched to 16.
#[test]
fn the_noise_of_a_board_in_a_dark_room_is_that_of_the_board() {
    const HEIGHT: usize = 256;
    let positions = sweep(HEIGHT);
    let lit = |i: usize| i / WIDTH < HEIGHT / 6;
    let variance = |level: f64| 0.03 + 0.024 * (level - 4.0);
    let scene = Scene {
        floor: 0.0,
        swing: 1.0,
        noise: 0.0,
        ..Scene::default()
    };
    let complements = gray(Axis::X, 8.0, 0..8, true);
    for patterns in [
        [equal(Axis::X, 16.0, 3), complements].concat(),
        [
            equal(Axis::X, 16.0, 12),
            gray(Axis::X, 8.0, 0..8, false),
            references(),
        ]
        .concat(),
    ] {
        let manifest = manifest(patterns);
        let frames: Vec<Vec<u16>> = (0..manifest.frame.len())
            .map(|k| {
                let levels = scene.frame(k, &manifest.frame[k].pattern, &positions);
                let dn = |(i, level): (usize, &f64)| {
                    // Ink and paper, and a light gradient.
                    let white = if i % 7 < 2 { 14.0 } else { 40.0 } + 0.15 * (i % WIDTH) as f64;
                    let clean = if lit(i) {
                        4.0 + 3.0 + white * level
                    } else {
                        4.0
                    };
                    let noise = variance(clean).sqrt() * normal((k as u64) << 32 | i as u64);
                    (clean + noise).round().clamp(0.0, 255.0) as u16
                };
                levels.iter().enumerate().map(dn).collect()
            })
            .collect();
        for factor in [1, 257] {
            let image = |frame: &Vec<u16>| match factor {
                1 => {
                    let bytes: Vec<u8> = frame.iter().map(|&v| v as u8).collect();
                    Image::new(WIDTH, HEIGHT, bytes).unwrap()
                }
                _ => {
                    let words: Vec<u16> = frame.iter().map(|v| v * factor).collect();
                    Image::new(WIDTH, HEIGHT, words).unwrap()
                }
            };
            let images: Vec<Image> = frames.iter().map(image).collect();
            let options = Options {
                keep_mixed: true,
                ..Options::default()
            };
            let decoder = Decoder::new(&manifest, WIDTH, HEIGHT, None, options).unwrap();
            let decoded = decoder.decode(&images).unwrap();
            let map = decoded.x.as_ref().unwrap();
            let whitened: Vec<f64> = (0..positions.len())
                .filter(|&i| lit(i) && !map.coordinate[i].is_nan())
                .map(|i| (f64::from(map.coordinate[i]) - positions[i][0]) / f64::from(map.sigma[i]))
                .filter(|z| z.abs() < 8.0)
                .collect();
            let n = whitened.len() as f64;
            let rms = (whitened.iter().map(|z| z * z).sum::<f64>() / n).sqrt();
            let model = decoded.noise.unwrap();
            let step = f64::from(factor);
            println!("x {factor}: {n} pixels, whitened {rms:.3}, {model:?}");
            assert!(n > 5000.0, "{n}");
            assert!((rms - 1.0).abs() < 0.1, "{factor}: {rms} {model:?}");
            for dn in [20.0, 60.0] {
                let truth = variance(dn) + 1.0 / 12.0;
                let found = model.variance_dn2(step * dn) / step.powi(2);
                assert!(
                    (found / truth - 1.0).abs() < 0.2,
                    "{factor} {dn}: {found} {truth}"
                );
            }
        }
    }
}

#[test]
fn rounding_of_twelve_steps_leaves_no_bias() {
    let positions = sweep(64);
    let scene = Scene {
        noise: 0.0,
        ..Scene::default()
    };
    let manifest = manifest([equal(Axis::X, 16.0, 12), gray(Axis::X, 8.0, 0..8, true)].concat());
    let decoded = scene.decode(&manifest, &positions, scene.options());
    let f = figures(&decoded, Axis::X, &positions, 1.0);
    // The bound for a noise variance of 1/12. It holds only approximately, because rounding errors
    // are not white noise.
    let bound = 16.0 / TAU * (2.0f64 / 12.0).sqrt() * (1.0f64 / 12.0).sqrt() / 90.0;
    assert!(f.coverage > 0.99 && f.rms < 1.5 * bound, "{f:?} {bound}");
    let map = decoded.x.as_ref().unwrap();
    let errors = positions
        .iter()
        .zip(&map.coordinate)
        .filter(|(_, x)| !x.is_nan());
    let (sum, n) = errors.fold((0.0, 0.0), |(s, n), (p, x)| {
        (s + f64::from(*x) - p[0], n + 1.0)
    });
    assert!((sum / n).abs() < 0.1 * bound, "{}", sum / n);
}
