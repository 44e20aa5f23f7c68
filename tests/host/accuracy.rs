//! Decodes rendered frames and compares them with the device's truth, in one process. The tolerances
//! are those that the demo must meet.

use phasmid::calibrate::height::Mapping;
use phasmid::decode::{Decoded, Decoder, Held, Options};
use phasmid::emulator::render::Renderer;
use phasmid::emulator::{PatternImage, Shot, Truth};
use phasmid::pattern::{Axis, Image, Pattern};
use phasmid::profile::{Profile, Scene};
use phasmid::study::score::{Score, score};
use std::f64::consts::TAU;
use std::sync::Arc;

fn scan(profile: &str, scene: &str, seed: u64, noise: bool) -> Score {
    full_scan(profile, scene, seed, noise).score
}

struct Scan {
    score: Score,
    truth: Truth,
    decoded: Decoded,
    /// Result of decoding without correction of the error due to held projector pixels; the error
    /// is only reported.
    uncorrected: Decoded,
    /// Signals of the fringe frames before noise and rounding, in DN, and their phases in radians.
    fringes: Vec<(Vec<f32>, f64)>,
}

fn full_scan(profile: &str, scene: &str, seed: u64, noise: bool) -> Scan {
    let mut profile = Profile::load(profile).unwrap();
    profile.camera.sensor.noiseless = !noise;
    let scene = Scene::load(scene).unwrap();
    let mut renderer = Renderer::new(&profile, &scene, seed).unwrap();
    let manifest = profile.manifest(&profile.sequence[0]);
    let shots: Vec<_> = manifest
        .frame
        .iter()
        .enumerate()
        .map(|(i, f)| {
            let pattern_image =
                PatternImage::new(&f.pattern, &profile.projector, &|_| unreachable!()).unwrap();
            let shot = Shot {
                id: i as u64,
                noise_id: i as u64,
                pattern_index: Some(i as u32),
                pattern_image: Some(Arc::new(pattern_image)),
                light: 1.0,
                exposure_ns: (profile.camera.exposure_us * 1e3) as u64,
                ..Shot::default()
            };
            (f.pattern.clone(), shot)
        })
        .collect();
    let frames: Vec<_> = shots.iter().map(|(_, s)| renderer.expose(s).data).collect();
    let truth = renderer.truth(&shots);
    let rig = profile.nominal_rig();
    let (w, h) = (truth.width as usize, truth.height as usize);
    let decode = |held| {
        let options = Options {
            held,
            ..Options::default()
        };
        let decoder = Decoder::new(&manifest, w, h, Some(&rig), options).unwrap();
        let images: Vec<_> = frames
            .iter()
            .map(|f| Image::new(w, h, f.clone()).unwrap())
            .collect();
        decoder.decode(&images).unwrap()
    };
    let [decoded, uncorrected] = [Held::Correct, Held::State].map(decode);
    let score = score(&decoded, &truth, &manifest, &rig).unwrap();
    println!("{} {} noise {noise}: {score:#?}", profile.name, scene.name);
    let fringes = shots
        .iter()
        .filter_map(|(pattern, shot)| match pattern {
            Pattern::Fringe { phase_rad, .. } => Some((renderer.expected_dn(shot), *phase_rad)),
            _ => None,
        })
        .collect();
    Scan {
        score,
        truth,
        decoded,
        uncorrected,
        fringes,
    }
}

#[test]
fn trapezoid_is_accurate_with_default_noise() {
    let s = scan("pmp-bench", "trapezoid", 1, true);
    assert!(s.mae_mm <= 0.035 && s.gross_error_rate <= 0.001, "{s:?}");
    assert!(s.coverage >= 0.99 && s.ratio_to_bound <= 1.15, "{s:?}");
    assert!(
        s.crease.gross_error_rate == 0.0 && s.crease.coverage >= 0.75,
        "{s:?}"
    );
}

/// Returns the mean absolute errors on the trapezoid by three methods: triangulation,
/// phase-to-height over a computed reference plane, and phase-to-height over a captured reference
/// plane.
fn both_ways(name: &str) -> [f64; 3] {
    let profile = Profile::load(name).unwrap();
    let (rig, manifest) = (
        profile.nominal_rig(),
        profile.manifest(&profile.sequence[0]),
    );
    let scan = full_scan(name, "trapezoid", 1, true);
    let plane = full_scan(name, "plane", 7, true).decoded;
    let map = plane.x.as_ref().unwrap();
    let depth = [&plane.depth[..], &plane.depth_sigma];
    let computed = Mapping::of_plane(&rig, Axis::X, 16.0, 1000.0);
    let captured = Mapping::of_capture(&rig, Axis::X, 16.0, [&map.coordinate, &map.sigma], depth);
    let [computed, captured] = [computed, captured].map(|mapping| {
        let mapping = mapping.unwrap();
        println!("{name} {:?} {:?}", mapping.constants, mapping.quality);
        let mut decoded = scan.decoded.clone();
        let map = scan.decoded.x.as_ref().unwrap();
        let coordinate = [&map.coordinate[..], &map.sigma];
        mapping.depths(coordinate, &mut decoded.depth, &mut decoded.depth_sigma);
        let score = score(&decoded, &scan.truth, &manifest, &rig).unwrap();
        assert!((score.coverage - scan.score.coverage).abs() < 2e-3);
        score.mae_mm
    });
    println!("{name}: MAE {} {computed} {captured} mm", scan.score.mae_mm);
    [scan.score.mae_mm, computed, captured]
}

#[test]
fn phase_to_height_is_as_good_as_triangulation_on_the_bench() {
    let [cut, computed, captured] = both_ways("pmp-bench");
    assert!((computed / cut - 1.0).abs() < 0.01);
    // The noise of the captured reference plane adds to the error; the plane is brighter than the
    // trapezoid's floor.
    assert!((1.05..1.42).contains(&(captured / cut)));
}

#[test]
#[ignore = "renders distorted lenses for half a minute; a lane of .ci/run does it"]
fn phase_to_height_is_worse_where_lenses_distort() {
    let [cut, computed, captured] = both_ways("pmp-real");
    assert!(computed > 1.3 * cut && captured > 1.3 * cut && captured < 3.0 * cut);
}

#[test]
fn trapezoid_is_accurate_without_noise() {
    let s = scan("pmp-bench", "trapezoid", 1, false);
    assert!(s.mae_mm <= 0.012 && s.gross_error_rate <= 0.001, "{s:?}");
}

#[test]
fn other_scenes_and_the_webcam_are_accurate() {
    for scene in ["torso", "sphere", "plane", "couch"] {
        let s = scan("pmp-bench", scene, 2, true);
        assert!(s.gross_error_rate <= 0.001, "{scene} {s:?}");
        assert!(s.coverage >= 0.99, "{scene} {s:?}");
        assert!(s.ratio_to_bound <= 1.25, "{scene} {s:?}");
        // Mixed pixels at slanted silhouettes and shadows. Without the border pass, 14 % of the
        // torso's, 17 % of the couch's and 5 % of the sphere's crease points have gross errors.
        let c = &s.crease;
        assert!(c.gross_error_rate <= 0.005, "{scene} {s:?}");
        assert!(c.points >= 850 && c.coverage >= 0.5, "{scene} {s:?}");
    }
    let s = scan("webcam-grey", "sphere", 3, true);
    assert!(s.gross_error_rate <= 0.005 && s.coverage >= 0.99, "{s:?}");
    assert!(s.crease.gross_error_rate <= 0.03, "{s:?}");
}

/// The effects of lenses, projector and sensor leave the error at the noise bound: the decoder
/// knows the distortions, and the other effects only reduce contrast.
#[test]
fn bench_with_real_parts_is_accurate() {
    for scene in ["trapezoid", "torso", "couch"] {
        let s = scan("pmp-real", scene, 4, true);
        assert!(
            s.mae_mm <= 0.035 && s.gross_error_rate <= 0.001,
            "{scene} {s:?}"
        );
        assert!(
            s.coverage >= 0.99 && s.ratio_to_bound <= 1.15,
            "{scene} {s:?}"
        );
        assert!(s.crease.gross_error_rate <= 0.005, "{scene} {s:?}");
    }
}

/// Returns the error in projector pixels that held projector pixels leave in a fringe of `period` px
/// at the coordinate `x`. The footprint has the derivatives `a` and `b` of x with respect to the
/// camera's column and row.
///
/// Held pixels are the fringe sampled at whole x and convolved with a box one pixel wide. Sampling
/// repeats the fringe's spectral line at 1/period + k for every integer k. All of these lines have
/// the same phase step from frame to frame, so that no number of steps separates them. Box and
/// footprint attenuate each line by sinc(f) sinc(a f) sinc(b f). The phase error is therefore the
/// sum over k of r(k) sin(2 pi k x), where r(k) is the amplitude of line k relative to line 0.
fn held_pixel_error(x: f64, [a, b]: [f64; 2], period: f64) -> f64 {
    let sinc = |t: f64| {
        let t = std::f64::consts::PI * t;
        if t == 0.0 { 1.0 } else { t.sin() / t }
    };
    let strength = |k: f64| {
        let f = k + 1.0 / period;
        sinc(f) * sinc(a * f) * sinc(b * f)
    };
    let sum: f64 = [-3.0, -2.0, -1.0, 1.0, 2.0, 3.0]
        .iter()
        .map(|&k| strength(k) / strength(0.0) * (TAU * k * x).sin())
        .sum();
    period / TAU * sum
}

/// Causes of the uncorrected error without noise, on the trapezoid (0.0120 px RMS, 0.0108 mm):
///
/// - 0.0102 px is due to held pixels, an optical effect with a closed form (above). It is in the
///   light itself: the phase of the frames before rounding, computed here in f64, shows it. The
///   decoder's correction removes it.
/// - 0.0062 px is due to rounding to whole DN. White noise of 1/12 DN^2 predicts 0.0065 px at the
///   modulation B of 64 DN that remains on the slopes.
/// - The remaining 0.0012 px is due to the projector's 8-bit levels, irradiance within a pixel, and
///   f32.
#[test]
fn the_error_without_noise_is_held_pixels_and_rounding() {
    const PERIOD: f64 = 16.0;
    let scan = full_scan("pmp-bench", "trapezoid", 1, false);
    let (truth, w) = (&scan.truth, scan.truth.width as usize);
    let usable = |i: usize| {
        let wanted = Truth::SEEN | Truth::LIT;
        truth.flags[i] & (wanted | Truth::CREASE) == wanted
    };
    let x = |i: usize| f64::from(truth.projector_x[i]);
    let [corrected, measured] =
        [&scan.decoded, &scan.uncorrected].map(|decoded| &decoded.x.as_ref().unwrap().coordinate);
    // Sums of the squares of the unrounded error, of this error minus the error of held pixels, and
    // of the decoded minus the unrounded error; the sum of the variances due to rounding; and the
    // sum of the squares of the corrected error.
    let (mut n, mut sums) = (0.0, [0.0; 5]);
    for i in w..truth.depth_mm.len() - w {
        let around = [i, i - 1, i + 1, i - w, i + w];
        if !around.into_iter().all(usable) || !measured[i].is_finite() {
            continue;
        }
        let slope = [(x(i + 1) - x(i - 1)) / 2.0, (x(i + w) - x(i - w)) / 2.0];
        let (c, s) = scan.fringes.iter().fold((0.0, 0.0), |(c, s), (dn, phase)| {
            let dn = f64::from(dn[i]);
            (c + dn * phase.cos(), s - dn * phase.sin())
        });
        let difference = s.atan2(c) / TAU * PERIOD - x(i);
        let unrounded = difference - PERIOD * (difference / PERIOD).round();
        let image = held_pixel_error(x(i), slope, PERIOD);
        let per_dn = PERIOD / TAU / f64::from(truth.modulation_dn[i]);
        n += 1.0;
        sums[0] += unrounded.powi(2);
        sums[1] += (unrounded - image).powi(2);
        sums[2] += (f64::from(measured[i]) - x(i) - unrounded).powi(2);
        sums[3] += per_dn.powi(2) * 2.0 / scan.fringes.len() as f64 / 12.0;
        sums[4] += (f64::from(corrected[i]) - x(i)).powi(2);
    }
    let [unrounded, rest, rounding, white, corrected] = sums.map(|s| (s / n).sqrt());
    println!(
        "px RMS: unrounded {unrounded}, rest {rest}, rounding {rounding}, white {white}, corrected \
         {corrected}"
    );
    assert!(corrected < 1.15 * rounding, "{corrected} {rounding}");
    assert!(
        n > 1e5 && (0.009..0.0115).contains(&unrounded),
        "{n} {unrounded}"
    );
    assert!(rest <= 0.0015, "{rest}");
    assert!(
        (0.8..1.1).contains(&(rounding / white)),
        "{rounding} {white}"
    );
}
