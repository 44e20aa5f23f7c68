//! The decoder against frames made here from the patterns' formulas, in f64 and without any of the
//! decoder's code. Inliers' error, gross errors and coverage are judged apart.

use phasma::decode::{Decoded, Decoder, FrameStack, Options, Samples, Verdict};
use phasma::geometry::NoiseModel;
use phasma::pattern::{Axis, Manifest, ManifestFrame, Pattern, ProjectorSize};
use proptest::prelude::*;
use rayon::prelude::*;
use std::f64::consts::TAU;

const WIDTH: usize = 256;

fn fringes(axis: Axis, period_px: f64, phases: &[f64]) -> Vec<Pattern> {
    phases
        .iter()
        .map(|&phase_rad| Pattern::Fringe {
            axis,
            period_px,
            phase_rad,
        })
        .collect()
}

fn equal(axis: Axis, period_px: f64, n: usize) -> Vec<Pattern> {
    let phases: Vec<f64> = (0..n).map(|i| TAU * i as f64 / n as f64).collect();
    fringes(axis, period_px, &phases)
}

fn gray(axis: Axis, cell_px: f64, bits: std::ops::Range<u32>, complements: bool) -> Vec<Pattern> {
    let all = bits.end;
    bits.rev()
        .flat_map(|bit| {
            [false, true]
                .into_iter()
                .take(1 + usize::from(complements))
                .map(move |inverted| Pattern::Gray {
                    axis,
                    cell_px,
                    bits: all,
                    bit,
                    inverted,
                })
        })
        .collect()
}

fn references() -> Vec<Pattern> {
    vec![Pattern::White {}, Pattern::Black {}]
}

fn manifest(patterns: Vec<Pattern>) -> Manifest {
    Manifest {
        projector: ProjectorSize {
            width_px: 1920,
            height_px: 1080,
        },
        frame: patterns
            .into_iter()
            .map(|pattern| ManifestFrame {
                file: None,
                pattern,
            })
            .collect(),
    }
}

/// What a camera sees of patterns: `floor + swing * level`, Gaussian noise, rounding.
#[derive(Clone, Copy)]
struct Scene {
    floor: f64,
    swing: f64,
    /// Standard deviation in DN before rounding.
    noise: f64,
    /// Projector pixels that a camera pixel's footprint covers.
    footprint: f64,
    seed: u64,
}

impl Default for Scene {
    fn default() -> Self {
        Self {
            floor: 20.0,
            swing: 180.0,
            noise: 1.5,
            footprint: 4.0,
            seed: 1,
        }
    }
}

/// SplitMix64's finaliser: a counter-based uniform in (0, 1).
fn uniform(counter: u64) -> f64 {
    let mut z = counter.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 + 1e-17
}

fn normal(counter: u64) -> f64 {
    (-2.0 * uniform(2 * counter).ln()).sqrt() * (TAU * uniform(2 * counter + 1)).cos()
}

impl Scene {
    /// Level of a pattern at a position: fringes as they are, Gray code as held pixels averaged
    /// over the footprint.
    fn level(&self, pattern: &Pattern, position: [f64; 2]) -> f64 {
        match *pattern {
            Pattern::Fringe {
                axis,
                period_px,
                phase_rad,
            } => 0.5 + 0.5 * (TAU * position[axis as usize] / period_px + phase_rad).cos(),
            Pattern::Gray { axis, .. } => {
                let x = position[axis as usize];
                let (lo, hi) = (x - 0.5 * self.footprint, x + 0.5 * self.footprint);
                let (mut sum, mut weight) = (0.0, 0.0);
                let mut i = (lo + 0.5).floor().max(0.0);
                while i - 0.5 < hi {
                    let overlap = (hi.min(i + 0.5) - lo.max(i - 0.5)).max(0.0);
                    sum += overlap * pattern.level(i as u32).unwrap();
                    weight += overlap;
                    i += 1.0;
                }
                sum / weight
            }
            ref uniform => uniform.level(0).unwrap(),
        }
    }

    fn frame(&self, index: usize, pattern: &Pattern, positions: &[[f64; 2]]) -> Vec<f64> {
        positions
            .iter()
            .enumerate()
            .map(|(i, &p)| {
                let counter = self.seed << 48 | (index as u64) << 32 | i as u64;
                let noise = if self.noise > 0.0 {
                    self.noise * normal(counter)
                } else {
                    0.0
                };
                self.floor + self.swing * self.level(pattern, p) + noise
            })
            .collect()
    }

    fn frames_u8(&self, manifest: &Manifest, positions: &[[f64; 2]]) -> Vec<Vec<u8>> {
        let frames = manifest.frame.par_iter().enumerate();
        frames
            .map(|(k, f)| self.frame(k, &f.pattern, positions))
            .map(|f| {
                f.iter()
                    .map(|v| v.round().clamp(0.0, 255.0) as u8)
                    .collect()
            })
            .collect()
    }

    fn noise_model(&self) -> NoiseModel {
        NoiseModel {
            gain_dn_per_e: 0.0,
            read_noise_dn: self.noise,
            black_level_dn: 0.0,
            saturation_dn: 255.0,
        }
    }

    fn options(&self) -> Options {
        Options {
            noise: Some(self.noise_model()),
            ..Options::default()
        }
    }

    fn decode(&self, manifest: &Manifest, positions: &[[f64; 2]], options: Options) -> Decoded {
        let frames = self.frames_u8(manifest, positions);
        let height = positions.len() / WIDTH;
        let decoder = Decoder::new(manifest, WIDTH, height, None, options).unwrap();
        let frames = frames.iter().map(|f| Samples::U8(f)).collect();
        decoder
            .decode(&FrameStack::new(WIDTH, height, frames).unwrap())
            .unwrap()
    }
}

/// A smooth surface that sweeps x over its range, with every sub-pixel phase.
fn sweep(height: usize) -> Vec<[f64; 2]> {
    (0..WIDTH * height)
        .map(|i| {
            let (u, v) = ((i % WIDTH) as f64, (i / WIDTH) as f64);
            let x = 10.0 + 7.37 * u + 3.0 * (v * 0.11).sin() + 0.0317 * v;
            [x, 5.0 + 8.3 * v + 0.21 * u]
        })
        .collect()
}

/// Error figures apart: coverage, rate of errors above `gross` among the valid, RMS of the others,
/// RMS of the others over their own standard deviation.
#[derive(Debug)]
struct Figures {
    coverage: f64,
    gross: f64,
    rms: f64,
    ratio: f64,
    sigma: f64,
}

fn figures(decoded: &Decoded, axis: Axis, positions: &[[f64; 2]], gross: f64) -> Figures {
    let map = decoded.axis(axis).unwrap();
    let (mut valid, mut wrong, mut squares, mut relative, mut sigmas) = (0, 0, 0.0, 0.0, 0.0);
    for (i, p) in positions.iter().enumerate() {
        assert_eq!(map.coordinate[i].is_nan(), map.verdict[i] != Verdict::Valid);
        assert_eq!(map.coordinate[i].is_nan(), map.sigma[i].is_nan());
        if map.coordinate[i].is_nan() {
            continue;
        }
        valid += 1;
        let error = f64::from(map.coordinate[i]) - p[axis as usize];
        if error.abs() > gross {
            wrong += 1;
            continue;
        }
        squares += error * error;
        relative += (error / f64::from(map.sigma[i])).powi(2);
        sigmas += f64::from(map.sigma[i]).powi(2);
    }
    let inliers = f64::from(valid - wrong).max(1.0);
    Figures {
        coverage: f64::from(valid) / positions.len() as f64,
        gross: f64::from(wrong) / f64::from(valid).max(1.0),
        rms: (squares / inliers).sqrt(),
        ratio: (relative / inliers).sqrt(),
        sigma: (sigmas / inliers).sqrt(),
    }
}

#[test]
fn phase_noise_sits_on_the_bound() {
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

#[test]
fn shot_noise_is_carried_pixel_by_pixel_even_with_three_steps() {
    // Variance 0.5 + 0.05 I: made here with its own noise per sample.
    let positions = sweep(128);
    let scene = Scene {
        noise: 0.0,
        ..Scene::default()
    };
    let manifest = manifest([equal(Axis::X, 16.0, 3), gray(Axis::X, 8.0, 0..8, true)].concat());
    let frames: Vec<Vec<u16>> = (0..manifest.frame.len())
        .map(|k| {
            let clean = scene.frame(k, &manifest.frame[k].pattern, &positions);
            clean
                .iter()
                .enumerate()
                .map(|(i, v)| {
                    let sigma = (0.5 + 0.05 * v).sqrt();
                    let noisy = v + sigma * normal((k as u64) << 32 | i as u64);
                    // Sixteen bits, so that rounding is nothing.
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
    let options = Options {
        noise: Some(noise),
        keep_mixed: true,
        ..Options::default()
    };
    let decoder = Decoder::new(&manifest, WIDTH, 128, None, options).unwrap();
    let frames = frames.iter().map(|f| Samples::U16(f)).collect();
    let stack = FrameStack::new(WIDTH, 128, frames).unwrap();
    let decoded = decoder.decode(&stack).unwrap();
    // Apart by where in the period the pixel is: the third harmonic shows there.
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

#[test]
fn exact_at_wraps_and_at_code_edges() {
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
        let frames = frames.iter().map(|f| Samples::U16(f)).collect();
        let decoded = decoder
            .decode(&FrameStack::new(WIDTH, 7, frames).unwrap())
            .unwrap();
        let f = figures(&decoded, Axis::X, &positions, 1e-3);
        assert!(f.gross == 0.0 && f.coverage == 1.0, "{f:?}");
    }
}

#[test]
fn every_way_to_find_the_order_finds_it() {
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

fn counts(decoded: &Decoded) -> [usize; 6] {
    let mut counts = [0; 6];
    for v in &decoded.axes().next().unwrap().1.verdict {
        counts[*v as usize] += 1;
    }
    counts
}

#[test]
fn both_axes_and_gray_alone() {
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
    // Uniform within a cell: cell / sqrt(12), less where an edge is seen.
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
        // Modulation over noise from 20 to 2.5.
        for (seed, noise) in [(1, 2.0), (2, 4.0), (3, 6.0), (4, 9.0), (5, 16.0)] {
            let scene = Scene {
                floor: 60.0,
                swing: 80.0,
                noise,
                seed,
                ..Scene::default()
            };
            // Without the help of neighbours.
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
fn saturated_and_dark_pixels_are_masked_and_said_so() {
    let positions = sweep(16);
    let manifest = manifest([equal(Axis::X, 16.0, 4), gray(Axis::X, 8.0, 0..8, true)].concat());
    let bright = Scene {
        floor: 100.0,
        swing: 220.0,
        ..Scene::default()
    };
    let decoded = bright.decode(&manifest, &positions, bright.options());
    let saturated = counts(&decoded)[Verdict::Saturated as usize];
    assert!(
        saturated > positions.len() * 3 / 4,
        "{:?}",
        counts(&decoded)
    );
    let dark = Scene {
        swing: 0.0,
        ..Scene::default()
    };
    let decoded = dark.decode(&manifest, &positions, dark.options());
    assert_eq!(counts(&decoded)[Verdict::Dim as usize], positions.len());
}

#[test]
fn a_lone_period_is_wrapped_or_unwrapped_along_space() {
    // One pixel in the plane is far below half a period.
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
    let shift = ((f64::from(s.coordinate[0]) - positions[0][0]) / 16.0).round() * 16.0;
    for (i, p) in positions.iter().enumerate() {
        let (a, b) = (f64::from(w.coordinate[i]), f64::from(s.coordinate[i]));
        assert!((0.0..16.0).contains(&a));
        assert!(((a - p[0] + 8.0).rem_euclid(16.0) - 8.0).abs() < 0.3);
        assert!((b - p[0] - shift).abs() < 0.3, "{i}");
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
    // Three steps and plain bits tell nothing; that is said.
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
    // The bound with a variance of 1/12; rounding is not white, so only nearly.
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

#[test]
fn threads_do_not_change_a_bit() {
    let positions = sweep(100);
    let scene = Scene::default();
    let patterns = [
        equal(Axis::X, 16.0, 4),
        gray(Axis::X, 8.0, 0..8, true),
        equal(Axis::Y, 64.0, 4),
        equal(Axis::Y, 70.0, 4),
    ];
    let manifest = manifest(patterns.concat());
    let [one, two] = [1, 2].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| scene.decode(&manifest, &positions, Options::default()))
    });
    let bits = |d: &Decoded| -> Vec<u32> {
        let maps = d
            .axes()
            .flat_map(|(_, m)| m.coordinate.iter().chain(&m.sigma));
        maps.chain(&d.modulation)
            .chain(&d.intensity)
            .map(|v| v.to_bits())
            .collect()
    };
    assert_eq!(bits(&one), bits(&two));
}

#[test]
fn frames_that_do_not_fit_are_refused() {
    let list = [equal(Axis::X, 16.0, 4), gray(Axis::X, 8.0, 0..8, true)].concat();
    let manifest = manifest(list);
    let decoder = Decoder::new(&manifest, 4, 3, None, Options::default()).unwrap();
    let frame = [0u8; 12];
    let stack = |n: usize| FrameStack::new(4, 3, vec![Samples::U8(&frame); n]).unwrap();
    assert!(decoder.decode(&stack(20)).is_ok());
    let error = decoder.decode(&stack(19)).unwrap_err().to_string();
    assert!(
        error.contains("19 frames") && error.contains("20 frames"),
        "{error}"
    );
    let other = FrameStack::new(3, 4, vec![Samples::U8(&frame); 20]).unwrap();
    assert!(decoder.decode(&other).is_err());
    assert!(FrameStack::new(4, 3, vec![Samples::U8(&frame[..11])]).is_err());
    assert!(FrameStack::new(4, 3, vec![Samples::U8(&frame), Samples::U16(&[0; 12])]).is_err());
    assert!(FrameStack::new(4, 3, vec![]).is_err());
    let mut holes = vec![Samples::U8(&frame); 20];
    holes[7] = Samples::U8(&[]);
    let error = decoder
        .decode(&FrameStack::new(4, 3, holes).unwrap())
        .unwrap_err();
    assert!(error.to_string().contains("frame 7"));
}

#[test]
fn pictures_in_a_sequence_need_no_frame() {
    let positions = sweep(8);
    let scene = Scene::default();
    let list = [equal(Axis::X, 16.0, 4), gray(Axis::X, 8.0, 0..8, true)].concat();
    let plain = manifest(list.clone());
    let mut with_picture = list;
    with_picture.insert(
        3,
        Pattern::Image {
            file: "speckle.png".into(),
        },
    );
    let frames = scene.frames_u8(&plain, &positions);
    let mut samples: Vec<Samples<'_>> = frames.iter().map(|f| Samples::U8(f)).collect();
    samples.insert(3, Samples::U8(&[]));
    let decoder = Decoder::new(&manifest(with_picture), WIDTH, 8, None, scene.options()).unwrap();
    let decoded = decoder
        .decode(&FrameStack::new(WIDTH, 8, samples).unwrap())
        .unwrap();
    let f = figures(&decoded, Axis::X, &positions, 4.0);
    assert!(f.gross == 0.0 && f.coverage > 0.99, "{f:?}");
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 40,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]
    #[test]
    fn random_sequences_come_back(
        period in 8.0..120.0f64,
        steps in 3usize..10,
        jitter in proptest::collection::vec(-0.3..0.3f64, 10),
        cell_divisor in 1u32..5,
        complements: bool,
        shuffle in any::<u64>(),
        footprint in 0.1..3.0f64,
        seed in 1u64..1000,
    ) {
        let phases: Vec<f64> =
            (0..steps).map(|i| TAU * i as f64 / steps as f64 + jitter[i]).collect();
        let cell = (period / f64::from(cell_divisor + 1)).floor().max(2.0);
        let bits = (1920.0 / cell).log2().ceil() as u32;
        let mut patterns = [
            fringes(Axis::X, period, &phases),
            gray(Axis::X, cell, 0..bits, complements),
            references(),
        ]
        .concat();
        // Any order of frames will do.
        patterns.sort_by_key(|p| uniform(shuffle ^ format!("{p:?}").len() as u64).to_bits());
        let scene = Scene { noise: 0.5, footprint, seed, ..Scene::default() };
        let positions = sweep(8);
        let decoded = scene.decode(&manifest(patterns), &positions, scene.options());
        let f = figures(&decoded, Axis::X, &positions, 0.4 * period);
        prop_assert!(f.gross == 0.0 && f.coverage > 0.98, "{f:?} {:?}", counts(&decoded));
        prop_assert!(f.ratio > 0.85 && f.ratio < 1.15, "{f:?}");
    }
}

fn any_pattern() -> impl Strategy<Value = Pattern> {
    let axis = || prop_oneof![Just(Axis::X), Just(Axis::Y)];
    prop_oneof![
        // Few values, so that sets and codes come about.
        6 => (axis(), prop_oneof![Just(2.5), Just(16.0), Just(24.0), Just(1e6)], 0u8..6).prop_map(
            |(axis, period_px, step)| Pattern::Fringe {
                axis,
                period_px,
                phase_rad: f64::from(step),
            }
        ),
        3 => (axis(), prop_oneof![Just(1.0), Just(8.0), Just(16.0), Just(1e6)], 0u32..9, any::<bool>())
            .prop_map(|(axis, cell_px, bit, inverted)| Pattern::Gray {
                axis,
                cell_px,
                bits: 9,
                bit,
                inverted,
            }),
        1 => Just(Pattern::White {}),
        1 => Just(Pattern::Black {}),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 300,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]
    #[test]
    fn no_sequence_and_no_frames_panic(
        patterns in proptest::collection::vec(any_pattern(), 1..40),
        size in prop_oneof![Just((1usize, 1usize)), Just((2, 3)), Just((9, 5))],
        noise in any::<u64>(),
        projector in prop_oneof![Just((1u32, 1u32)), Just((100, 60)), Just((1920, 1080))],
        unwrap_spatial: bool,
    ) {
        let mut manifest = manifest(patterns);
        (manifest.projector.width_px, manifest.projector.height_px) = projector;
        let options = Options { unwrap_spatial, ..Options::default() };
        if let Ok(decoder) = Decoder::new(&manifest, size.0, size.1, None, options) {
            let pixels = size.0 * size.1;
            let frames: Vec<Vec<u16>> = (0..manifest.frame.len() * pixels)
                .map(|i| (uniform(noise.wrapping_add(i as u64)) * 65536.0) as u16)
                .collect::<Vec<_>>()
                .chunks(pixels)
                .map(<[u16]>::to_vec)
                .collect();
            let frames = frames.iter().map(|f| Samples::U16(f)).collect();
            let decoded = decoder.decode(&FrameStack::new(size.0, size.1, frames).unwrap()).unwrap();
            for (_, map) in decoded.axes() {
                for (v, x) in map.verdict.iter().zip(&map.coordinate) {
                    prop_assert_eq!(*v == Verdict::Valid, x.is_finite());
                }
            }
        }
    }
}
