//! The sensor, measured as on a camera test bench by EMVA 1288 release 4.0, from its frames alone.
//!
//! Each measured figure is compared with the profile's value, with fixed seeds.

use phasmid::emulator::render::{Renderer, Term};
use phasmid::emulator::{PatternImage, Shot};
use phasmid::profile::{CameraResponse, Glare, Profile, Scene};
use phasmid::protocol::PixelFormat;
use std::sync::Arc;

/// Returns a scene like the integrating sphere of a test bench: a plane that fills the image,
/// uniformly lit by ambient light alone.
fn sphere() -> Scene {
    let text = "name = \"sphere\"\ndescription = \"\"\nambient = { irradiance_w_m2 = 0.5 }\n\
                [[object]]\nshape = { kind = \"plane\" }\nposition_mm = [0, 0, 1000]\n\
                albedo = 0.8\n";
    Scene::parse(text, "sphere").unwrap()
}

/// Returns a profile of a 12-bit camera whose read noise is several DN, large enough to be measured.
fn camera(change: impl FnOnce(&mut Profile)) -> Profile {
    let mut profile = Profile::load("pmp-bench").unwrap();
    profile.camera.format = PixelFormat::Y16;
    let sensor = &mut profile.camera.sensor;
    sensor.bits = 12;
    sensor.black_level_dn = 64.0;
    sensor.gain_dn_per_e = 0.38;
    sensor.read_noise_e = 5.0;
    change(&mut profile);
    profile
}

struct Bench {
    renderer: Renderer,
    profile: Profile,
    /// Electrons per second and pixel.
    rate: f64,
    next: u64,
}

impl Bench {
    fn new(profile: Profile) -> Self {
        let renderer = |p: &Profile| Renderer::new(p, &sphere(), 3).unwrap();
        let mut linear = Profile { ..profile.clone() };
        let s = &mut linear.camera.sensor;
        (s.dark_current_e_s, s.prnu_percent, s.dsnu_e) = (0.0, 0.0, 0.0);
        s.response = CameraResponse::default();
        let dn = renderer(&linear).expected_dn(&shot(1e-4, 0))[1000];
        let s = &linear.camera.sensor;
        let rate = (f64::from(dn) - s.black_level_dn) / s.gain_dn_per_e / 1e-4;
        assert!(rate > 0.0);
        Self {
            renderer: renderer(&profile),
            profile,
            rate,
            next: 0,
        }
    }

    /// Takes the next frame, with an exposure in seconds.
    fn frame(&mut self, seconds: f64) -> Vec<f64> {
        self.next += 1;
        let data = self.renderer.expose(&shot(seconds, self.next)).data;
        if self.profile.camera.sensor.bits == 8 {
            return data.iter().map(|&b| f64::from(b)).collect();
        }
        let (words, _) = data.as_chunks();
        words
            .iter()
            .map(|w| f64::from(u16::from_le_bytes(*w)))
            .collect()
    }

    /// Returns the mean over the pixels, and the temporal variance from the difference of two frames
    /// (EMVA 1288, equations 32 and 33), without the 1/12 of quantisation.
    fn photon_transfer(&mut self, seconds: f64) -> (f64, f64) {
        let (a, b) = (self.frame(seconds), self.frame(seconds));
        let n = a.len() as f64;
        let mean = (a.iter().sum::<f64>() + b.iter().sum::<f64>()) / (2.0 * n);
        let (d1, d2) = a.iter().zip(&b).fold((0.0, 0.0), |(d1, d2), (a, b)| {
            (d1 + (a - b), d2 + (a - b).powi(2))
        });
        (mean, (d2 / n - (d1 / n).powi(2)) / 2.0 - 1.0 / 12.0)
    }

    /// Returns the pixel-wise mean of `count` frames, and the spatial variance corrected for
    /// residual temporal noise (EMVA 1288, section 8).
    fn spatial(&mut self, seconds: f64, count: u32) -> (f64, f64) {
        let mut sums = self.frame(seconds);
        let mut squares: Vec<f64> = sums.iter().map(|v| v * v).collect();
        for _ in 1..count {
            for ((s, q), v) in sums.iter_mut().zip(&mut squares).zip(self.frame(seconds)) {
                (*s, *q) = (*s + v, *q + v * v);
            }
        }
        let (n, l) = (sums.len() as f64, f64::from(count));
        let mean = sums.iter().sum::<f64>() / (n * l);
        let spatial = sums.iter().map(|s| (s / l - mean).powi(2)).sum::<f64>() / n;
        let temporal = sums
            .iter()
            .zip(&squares)
            .map(|(s, q)| (q - s * s / l) / (l - 1.0))
            .sum::<f64>()
            / n;
        (mean, spatial - temporal / l)
    }
}

fn shot(seconds: f64, id: u64) -> Shot {
    Shot {
        id,
        noise_id: id,
        pattern_image: None,
        light: 0.0,
        exposure_ns: (seconds * 1e9) as u64,
        ..Shot::default()
    }
}

/// Returns the slope and intercept of a least-squares line.
fn line(points: &[(f64, f64)]) -> (f64, f64) {
    let n = points.len() as f64;
    let (x, y) = points
        .iter()
        .fold((0.0, 0.0), |s, p| (s.0 + p.0 / n, s.1 + p.1 / n));
    let slope = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>()
        / points.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>();
    (slope, y - slope * x)
}

#[test]
fn photon_transfer_gives_back_gain_and_read_noise() {
    for (gain, read_noise) in [(0.38, 5.0), (0.38, 2.3), (1.9, 1.2)] {
        let mut bench = Bench::new(camera(|p| {
            p.camera.sensor.gain_dn_per_e = gain;
            p.camera.sensor.read_noise_e = read_noise;
        }));
        let saturation = (4095.0 - 64.0) / gain;
        let (dark_mean, dark_variance) = bench.photon_transfer(0.0);
        assert!((dark_mean - 64.0).abs() < 0.02, "{dark_mean}");
        let points: Vec<_> = [0.002, 0.005, 0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]
            .into_iter()
            .map(|fill| {
                let seconds = fill * saturation / bench.rate;
                let (mean, variance) = bench.photon_transfer(seconds);
                (mean - dark_mean, variance - dark_variance)
            })
            .collect();
        let (slope, _) = line(&points);
        assert!((slope / gain - 1.0).abs() < 0.01, "gain {slope} of {gain}");
        // Each point lies on the line, even points at a few electrons.
        for (mean, variance) in &points {
            assert!(
                (variance / mean / gain - 1.0).abs() < 0.02,
                "{mean}: {variance}"
            );
        }
        let found = dark_variance.sqrt() / slope;
        assert!(
            (found / read_noise - 1.0).abs() < 0.03,
            "read noise {found} of {read_noise}"
        );
    }
}

#[test]
fn dark_current_grows_with_the_exposure_and_makes_shot_noise() {
    let mut bench = Bench::new(camera(|p| p.camera.sensor.dark_current_e_s = 150.0));
    // Without ambient light, the exposures contain dark current only.
    let text = "name = \"dark\"\ndescription = \"\"\n[[object]]\nshape = { kind = \"plane\" }\n\
                position_mm = [0, 0, 1000]\nalbedo = 0.5\n";
    let dark = Scene::parse(text, "dark").unwrap();
    bench.renderer = Renderer::new(&bench.profile, &dark, 3).unwrap();
    let sensor = bench.profile.camera.sensor.clone();
    for seconds in [1e-6, 0.1, 1.0, 10.0] {
        let (mean, variance) = bench.photon_transfer(seconds);
        let electrons = 150.0 * seconds;
        assert!(
            (mean - 64.0 - 0.38 * electrons).abs() < 0.03,
            "{seconds}: {mean}"
        );
        let expected = 0.38f64.powi(2) * (25.0 + electrons);
        assert!(
            (variance / expected - 1.0).abs() < 0.015,
            "{seconds}: {variance} {expected}"
        );
        let told = sensor.noise_model(0.0, seconds);
        assert!((told.variance_dn2(mean) - 1.0 / 12.0 - expected).abs() < 0.02 * expected);
        assert!((told.black_level_dn - mean).abs() < 0.03);
    }
}

#[test]
fn prnu_and_dsnu_are_found_by_the_standards_method() {
    let mut bench = Bench::new(camera(|p| {
        p.camera.sensor.prnu_percent = 0.8;
        p.camera.sensor.dsnu_e = 3.0;
    }));
    let half = 0.5 * (4095.0 - 64.0) / 0.38 / bench.rate;
    let (dark, dark_spread) = bench.spatial(0.0, 12);
    let (light, light_spread) = bench.spatial(half, 12);
    let dsnu = dark_spread.sqrt() / 0.38;
    assert!((dsnu / 3.0 - 1.0).abs() < 0.02, "DSNU {dsnu}");
    let prnu = (light_spread - dark_spread).sqrt() / (light - dark) * 100.0;
    assert!((prnu / 0.8 - 1.0).abs() < 0.02, "PRNU {prnu}");
}

/// The fixed pattern of a device does not depend on the noise seed; another device has another fixed
/// pattern.
#[test]
fn fixed_pattern_depends_on_device_not_on_noise_seed() {
    let expected = |pattern_seed: u64, noise_seed: u64| {
        let profile = camera(|p| {
            p.camera.sensor.prnu_percent = 2.0;
            p.camera.sensor.dsnu_e = 4.0;
            p.camera.sensor.pattern_seed = pattern_seed;
        });
        let mut renderer = Renderer::new(&profile, &sphere(), noise_seed).unwrap();
        renderer.expected_dn(&shot(1e-3, 0))
    };
    assert_eq!(expected(1, 5), expected(1, 6));
    let (a, b) = (expected(1, 5), expected(2, 5));
    let n = a.len() as f64;
    let mean = |v: &[f32]| v.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
    let (ma, mb) = (mean(&a), mean(&b));
    let product = |x: &[f32], y: &[f32]| {
        let pairs = x.iter().zip(y);
        pairs
            .map(|(x, y)| (f64::from(*x) - ma) * (f64::from(*y) - mb))
            .sum::<f64>()
            / n
    };
    let correlation = product(&a, &b) / (product(&a, &a) * product(&b, &b)).sqrt();
    assert!(correlation.abs() < 5.0 / n.sqrt(), "{correlation}");
}

#[test]
fn a_gamma_response_is_its_formula_and_its_inverse_gives_light_back() {
    let gamma = CameraResponse::Gamma { gamma: 2.2 };
    let mut bench = Bench::new(camera(|p| p.camera.sensor.response = gamma));
    let mut flat = Bench::new(camera(|_| ()));
    for fill in [0.0, 0.02, 0.3, 0.9] {
        let seconds = fill * 10500.0 / bench.rate;
        let bent = bench.renderer.expected_dn(&shot(seconds, 0))[5];
        let linear = flat.renderer.expected_dn(&shot(seconds, 0))[5];
        let exact = 4095.0 * (f64::from(linear) / 4095.0).powf(1.0 / 2.2);
        assert!((f64::from(bent) - exact).abs() < 0.01, "{bent} {exact}");
        let frame = bench.frame(seconds);
        let mean = frame
            .iter()
            .map(|&dn| gamma.invert(dn, 4095.0))
            .sum::<f64>()
            / frame.len() as f64;
        let off = (mean - f64::from(linear)).abs();
        assert!(off < 0.02 + 1e-3 * f64::from(linear), "{mean} {linear}");
    }
    // The noise model that the device reports to the host is only a linear fit, but it is finite.
    let told = bench.profile.camera.sensor.noise_model(0.0, 8e-3);
    let black = 4095.0 * (64.0f64 / 4095.0).powf(1.0 / 2.2);
    assert!((told.black_level_dn - black).abs() < 1e-9);
    let (mean, variance) = bench.photon_transfer(0.3 * 10500.0 / bench.rate);
    let ratio = told.variance_dn2(mean) / (variance + 1.0 / 12.0);
    assert!((0.4..2.5).contains(&ratio), "{ratio}");
}

/// Glare preserves the sum of the light of a bright rectangle, and blooming fills a column.
#[test]
fn glare_and_blooming_reach_the_frames() {
    let scene = Scene::load("plane").unwrap();
    let lit = |profile: &Profile, seconds: f64| {
        let pattern_image = Arc::new(PatternImage::Uniform(255));
        let mut renderer = Renderer::new(profile, &scene, 3).unwrap();
        renderer.expected_dn(&Shot {
            pattern_image: Some(pattern_image),
            light: 1.0,
            ..shot(seconds, 0)
        })
    };
    let plain = camera(|_| ());
    let above = |dn: &[f32]| dn.iter().map(|&v| f64::from(v) - 64.0).sum::<f64>();
    let before = lit(&plain, 2e-3);
    let scattered = lit(
        &camera(|p| {
            p.camera.glare = Some(Glare {
                percent: 5.0,
                sigma_px: 60.0,
            });
        }),
        2e-3,
    );
    assert!((above(&scattered) / above(&before) - 1.0).abs() < 1e-3);
    let halo = before
        .iter()
        .zip(&scattered)
        .filter(|(before, _)| **before == 64.0)
        .map(|(_, &scattered)| scattered)
        .fold(0.0, f32::max);
    // At a straight edge, half of the scattered light comes from the other side of the edge.
    let white = before.iter().copied().fold(0.0, f32::max) - 64.0;
    assert!(
        (0.02 * white..0.03 * white).contains(&(halo - 64.0)),
        "{halo} {white}"
    );
    // The centre has four times the full well, so the streak is at least as long as this excess
    // requires.
    let full = (64.0 + 0.38 * 10500.0f32).min(4095.0);
    let count = |profile: &Profile| lit(profile, 3e-2).iter().filter(|&&dn| dn >= full).count();
    let bloomed = count(&camera(|p| p.camera.sensor.blooming_percent = 100.0));
    assert!(bloomed as f64 > 1.5 * count(&plain) as f64, "{bloomed}");
}

/// With all terms at once, frames are within the converter's range and have the same bytes for any
/// number of threads: after a billion frames, in the dark and far beyond saturation, and at 1 us and
/// 10 s.
#[test]
fn extremes_are_numbers_and_the_same_on_any_number_of_threads() {
    let all = camera(|p| {
        p.camera.glare = Some(Glare {
            percent: 3.0,
            sigma_px: 40.0,
        });
        let s = &mut p.camera.sensor;
        s.dark_current_e_s = 20.0;
        s.prnu_percent = 1.0;
        s.dsnu_e = 2.0;
        s.blooming_percent = 50.0;
        s.response = CameraResponse::Gamma { gamma: 2.2 };
    });
    let scene = Scene::load("trapezoid").unwrap();
    let frames = |profile: &Profile, threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let mut renderer = Renderer::new(profile, &scene, u64::MAX).unwrap();
            let shots = [0, 1, 1_000_000_000, u64::MAX].into_iter().flat_map(|id| {
                [0.0, 1e-6, 8e-3, 10.0].map(|seconds| {
                    let levels: Vec<u16> = (0..1920).map(|i| (i / 8 % 2 * 255) as u16).collect();
                    Shot {
                        pattern_image: Some(Arc::new(PatternImage::Row(
                            phasmid::pattern::Axis::X,
                            levels,
                        ))),
                        light: 1.0,
                        gain_db: if id == 1 { 24.0 } else { 0.0 },
                        ..shot(seconds, id)
                    }
                })
            });
            shots
                .map(|shot| renderer.expose(&shot).data)
                .collect::<Vec<_>>()
        })
    };
    let plain = camera(|_| ());
    for profile in [&all, &plain] {
        let one = frames(profile, 1);
        assert_eq!(one, frames(profile, 3));
        for data in &one {
            let (words, _) = data.as_chunks();
            assert!(words.iter().all(|w| u16::from_le_bytes(*w) <= 4095));
        }
        // Another frame has other noise, even late in a run.
        assert_ne!(one[2], one[10]);
    }
}

/// Enabling each term of the sensor with a neutral parameter changes no byte.
#[test]
fn neutral_sensor_terms_change_no_byte() {
    let profile = camera(|_| ());
    let mut lean = Renderer::new(&profile, &sphere(), 3).unwrap();
    let before = lean.expose(&shot(1e-3, 4)).data;
    for term in [
        Term::Glare,
        Term::DarkCurrent,
        Term::FixedPattern,
        Term::Blooming,
        Term::CameraResponse,
    ] {
        assert!(!lean.plan().has(term), "{term}");
        lean.force(term, true);
        assert_eq!(lean.expose(&shot(1e-3, 4)).data, before, "{term}");
        lean.force(term, false);
    }
}
