//! A rolling shutter compared with closed forms: patterns that leak into rows exposed late, bands of
//! mains flicker, and whole scans through the firmware.

use crate::photometry::{dn_per_irradiance, scene};
use phasmid::decode::{Decoded, Decoder, Held, Options, Verdict};
use phasmid::decode::{Known, check_sequence};
use phasmid::emulator::render::{Renderer, Term};
use phasmid::emulator::{Device, MemorySink, PatternImage, Shot, Showing, Shutter};
use phasmid::pattern::{Axis, Image, Pattern};
use phasmid::profile::{Profile, Scene};
use phasmid::protocol::Frame;
use std::f64::consts::TAU;
use std::path::Path;
use std::sync::Arc;

const WIDTH: usize = 1138;
const ROWS: u32 = 489;

fn rolling(line_time_us: f64) -> Profile {
    let mut profile = Profile::load("pmp-bench").unwrap();
    profile.camera.line_time_us = line_time_us;
    profile
}

fn shutter(line_time_ns: u64) -> Shutter {
    Shutter {
        line_time_ns,
        first_row: 0,
        rows: ROWS,
    }
}

fn fringe(profile: &Profile, axis: Axis, period_px: f64) -> Arc<PatternImage> {
    let pattern = Pattern::Fringe {
        axis,
        period_px,
        phase_rad: 0.4,
    };
    Arc::new(PatternImage::new(&pattern, &profile.projector, &|_| unreachable!()).unwrap())
}

/// Each row is the mean of the row under each pattern image alone, weighted by the time for which
/// the row sees that pattern image. This includes pixels on edges, which are sampled.
#[test]
fn pattern_images_leak_into_rows_by_the_time_that_they_share() {
    let mut profile = rolling(10.0);
    profile.projector.focus = toml::from_str("distance_mm = 900\naperture_mm = 6").ok();
    let scene = Scene::load("sphere").unwrap();
    let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
    let (exposure_ns, line_ns) = (3_000_000, 10_000);
    let showing = |from_ns, pattern_image: Option<Arc<PatternImage>>, light| Showing {
        from_ns,
        pattern_image,
        light,
    };
    let start_ns = 5_000_000_000;
    let first = Shot {
        pattern_image: Some(fringe(&profile, Axis::X, 24.0)),
        light: 1.0,
        start_ns,
        exposure_ns,
        ..Shot::default()
    };
    // A finer fringe, half a millisecond of darkness, and one fringe along the other axis at less
    // light.
    let then = vec![
        showing(
            start_ns + 3_500_000,
            Some(fringe(&profile, Axis::X, 9.0)),
            0.9,
        ),
        showing(start_ns + 5_000_000, None, 1.0),
        showing(
            start_ns + 5_500_000,
            Some(fringe(&profile, Axis::Y, 30.0)),
            0.6,
        ),
    ];
    for first_row in [0, 100] {
        let shot = Shot {
            then: then.clone(),
            shutter: Shutter {
                line_time_ns: line_ns,
                first_row,
                rows: ROWS - first_row,
            },
            ..first.clone()
        };
        let found = renderer.expected_dn(&shot);
        let alone: Vec<Vec<f32>> = std::iter::once(first.clone())
            .chain(then.iter().map(|next| Shot {
                pattern_image: next.pattern_image.clone(),
                light: next.light,
                ..first.clone()
            }))
            .map(|shot| renderer.expected_dn(&shot))
            .collect();
        assert!(alone.iter().flatten().all(|&dn| dn < 254.0), "linear");
        let ends = [3.5, 5.0, 5.5, f64::INFINITY];
        let mut seen = [false; 4];
        for row in 0..ROWS {
            let begin = 1e-2 * f64::from(row.saturating_sub(first_row));
            let mut from = 0.0;
            let shares = ends.map(|to| {
                let (a, b) = (begin.max(from), (begin + 3.0).min(to));
                from = to;
                (b - a).max(0.0) / 3.0
            });
            assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            for (seen, share) in seen.iter_mut().zip(shares) {
                *seen |= share > 0.3;
            }
            for i in row as usize * WIDTH..(row as usize + 1) * WIDTH {
                let of_pattern_images = shares.iter().zip(&alone);
                let exact: f64 = of_pattern_images.map(|(w, dn)| w * f64::from(dn[i])).sum();
                let error = (f64::from(found[i]) - exact).abs();
                assert!(error < 1e-3, "row {row}, {i}: {} {exact}", found[i]);
            }
        }
        assert_eq!(
            seen,
            [true, true, false, true],
            "darkness takes less than 0.3 of each exposure"
        );
        let frame = renderer.expose(&shot);
        let rows = u64::from(ROWS - first_row);
        let times = (frame.exposure_start_ns, frame.exposure_end_ns - start_ns);
        assert_eq!(times, (start_ns, (rows - 1) * line_ns + exposure_ns));
    }
}

const AMBIENT: &str = "ambient = { irradiance_w_m2 = 0.3, flicker = { frequency_hz = 100, \
    depth = 0.8, phase_deg = 25 } }\n[[object]]\nshape = { kind = \"plane\" }\n\
    position_mm = [0, 0, 1000]\nalbedo = 0.7\n";

#[test]
fn rolling_shutter_sees_bands_of_mains_light() {
    let (line_s, exposure_s) = (25e-6, 4e-3);
    let profile = rolling(25.0);
    let scene = scene(AMBIENT, Path::new(""));
    let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
    // A whole number of seconds is a whole number of flicker periods.
    let found = renderer.expected_dn(&Shot {
        start_ns: 86_400_000_000_000_000,
        exposure_ns: 4_000_000,
        shutter: shutter(25_000),
        ..Shot::default()
    });
    let scale = 0.7 * dn_per_irradiance(&profile, 1.0);
    let black = profile.camera.sensor.black_level_dn;
    let row = |r: usize| f64::from(found[r * WIDTH]);
    for (i, &dn) in found.iter().enumerate() {
        let begin = line_s * (i / WIDTH) as f64;
        let phase = |t: f64| (TAU * 100.0 * t + f64::to_radians(25.0)).sin();
        let wave = (phase(begin + exposure_s) - phase(begin)) / (TAU * 100.0);
        let exact = black + scale * 0.3 * (exposure_s + 0.8 * wave);
        assert!((f64::from(dn) - exact).abs() < 1e-3, "{i}: {dn} {exact}");
    }
    // One band every 1 / (f line time) rows, with the contrast sin(pi f T) / (pi f T).
    let bands = (1.0 / (100.0 * line_s)).round() as usize;
    assert_eq!(bands, 400);
    for r in 0..ROWS as usize - bands {
        assert!((row(r) - row(r + bands)).abs() < 1e-4, "{r}");
    }
    let (low, high) = (0..bands).fold((f64::MAX, 0.0f64), |(low, high), r| {
        (low.min(row(r)), high.max(row(r)))
    });
    let contrast = (high - low) / (high + low - 2.0 * black);
    let x = TAU / 2.0 * 100.0 * exposure_s;
    assert!((contrast - 0.8 * x.sin() / x).abs() < 1e-4, "{contrast}");
    // Exposures that last a whole number of periods show no bands.
    let mut whole_periods = |shutter| {
        renderer.expected_dn(&Shot {
            exposure_ns: 10_000_000,
            shutter,
            ..Shot::default()
        })
    };
    assert!(whole_periods(shutter(25_000)) == whole_periods(Shutter::default()));
}

/// With steady light and one pattern image, the bytes of a frame do not depend on the shutter. With
/// a line time of 0, this holds in any light. Pattern images after the end of the last row's
/// exposure have no effect.
#[test]
fn without_a_cause_rows_are_those_of_a_global_shutter() {
    let flickering = scene(
        &format!(
            "{AMBIENT}[[object]]\nshape = {{ kind = \"sphere\", radius_mm = 90 }}\n\
             position_mm = [0, 0, 850]\nalbedo = 0.6\n"
        ),
        Path::new(""),
    );
    let steady = Scene::load("torso").unwrap();
    for (scene, line_time_ns) in [(&flickering, 0), (&steady, 0), (&steady, 12_000)] {
        let profile = rolling(line_time_ns as f64 / 1e3);
        let global = Shot {
            pattern_image: Some(fringe(&profile, Axis::X, 16.0)),
            light: 1.0,
            start_ns: 3_300_000,
            exposure_ns: 8_000_000,
            ..Shot::default()
        };
        let mut renderer = Renderer::new(&rolling(0.0), scene, 3).unwrap();
        let without = renderer.expose(&global);
        assert!(!renderer.plan().has(Term::RollingShutter));
        let mut renderer = Renderer::new(&profile, scene, 3).unwrap();
        assert_eq!(renderer.plan().has(Term::RollingShutter), line_time_ns > 0);
        renderer.force(Term::RollingShutter, true);
        let mut shot = Shot {
            shutter: shutter(line_time_ns),
            ..global
        };
        shot.then = vec![Showing {
            from_ns: shot.end_ns(),
            pattern_image: None,
            light: 0.0,
        }];
        assert!(
            renderer.expose(&shot).data == without.data,
            "{}",
            scene.name
        );
    }
}

/// Returns frames of the first sequence through the firmware, with a period in microseconds.
fn scan(profile: &Profile, period_us: u32) -> Vec<Frame> {
    let scene = Scene::load("plane").unwrap();
    let mut bench = Device::builder(profile, &scene)
        .seed(1)
        .build()
        .unwrap()
        .bench(MemorySink::default());
    let lines = format!("SEQ:PER {period_us}us\nTRIG:SOUR BUS\nINIT\n*TRG\nSYST:ERR?\n");
    let reply = bench.control(lines.as_bytes());
    assert_eq!(String::from_utf8_lossy(&reply), "0,\"No error\"\n");
    bench.sink.frames.iter().map(|f| (**f).clone()).collect()
}

fn decode(profile: &Profile, frames: &[Frame]) -> Decoded {
    let manifest = profile.manifest(&profile.sequence[0]);
    let (w, h) = (frames[0].width as usize, frames[0].height as usize);
    let rig = profile.nominal_rig();
    // Held projector pixels are not corrected, since the correction depends on the whole image and
    // rows would affect each other.
    let options = Options {
        held: Held::State,
        ..Options::default()
    };
    let decoder = Decoder::new(&manifest, w, h, Some(&rig), options).unwrap();
    let images: Vec<_> = frames
        .iter()
        .map(|f| Image::new(w, h, f.data.clone()).unwrap())
        .collect();
    decoder.decode(&images).unwrap()
}

/// Returns, for some rows, the number of pixels that are valid in one decoding, the number of them
/// that are also valid in the other, and the largest difference of their coordinates.
fn compared(one: &Decoded, other: &Decoded, rows: std::ops::Range<usize>) -> (usize, usize, f32) {
    let [one, other] = [one, other].map(|decoded| decoded.x.as_ref().unwrap());
    let width = 640;
    (rows.start * width..rows.end * width)
        .filter(|&i| one.verdict[i] == Verdict::Valid)
        .fold((0, 0, 0.0), |(valid, both, worst), i| {
            if other.verdict[i] != Verdict::Valid {
                return (valid + 1, both, worst);
            }
            let apart = (one.coordinate[i] - other.coordinate[i]).abs();
            (valid + 1, both + 1, worst.max(apart))
        })
}

/// With a period as long as the frame, the scan equals a scan with a global shutter. With a shorter
/// period, the lower rows also see the next pattern image. This biases coordinates in proportion,
/// and the check of the sequence rejects the capture, because its steps contradict each other even
/// where the decoder's masks keep most pixels. If the next pattern image lights a row for a quarter
/// of its exposure, the fringe order becomes uncertain (`Verdict::Uncertain`).
#[test]
fn a_period_too_short_for_the_rows_is_seen_in_the_frames() {
    let mut global = Profile::load("webcam-grey").unwrap();
    global.camera.data_line = false;
    let mut profile = global.clone();
    // The readout takes 9.6 ms, the exposure 12 ms.
    profile.camera.line_time_us = 20.0;
    let manifest = profile.manifest(&profile.sequence[0]);
    let check = |frames: &[Frame]| {
        let images = frames
            .iter()
            .map(|frame| frame.clone().into_image().unwrap());
        check_sequence(&manifest, &images.collect::<Vec<_>>(), Known::default())
    };
    let clean = scan(&profile, 21_580);
    let plain = scan(&global, 21_580);
    assert_eq!(clean.len(), manifest.frame.len());
    for (a, b) in clean.iter().zip(&plain) {
        assert!(a.data == b.data, "frame {:?}", a.pattern_index);
        assert_eq!(a.exposure_start_ns, b.exposure_start_ns);
        assert_eq!(a.exposure_end_ns, b.exposure_end_ns + 479 * 20_000);
    }
    assert_eq!(check(&clean), Ok(()));
    let sound = decode(&global, &clean);
    let lit = compared(&sound, &sound, 0..480).0;
    assert!(lit > 120_000, "{lit}");

    // Row r sees the next pattern image for max(0, 20 us r + 12 ms - period): from row 200 on.
    let short = scan(&profile, 16_000);
    let told = check(&short).unwrap_err().to_string();
    assert!(told.contains("contradict each other"), "{told}");
    let leaking = decode(&profile, &short);
    for (a, b) in short.iter().zip(&clean) {
        let to = 640
            * if a.pattern_index == Some(12) {
                480
            } else {
                201
            };
        assert!(a.data[..to] == b.data[..to], "frame {:?}", a.pattern_index);
    }
    let (valid, both, worst) = compared(&sound, &leaking, 0..201);
    assert!(valid == both && worst < 0.02, "{valid} {both} {worst}");
    // A tenth of the next step shifts the phase by atan(0.1 / 0.9), which is 0.28 px with a period
    // of 16 px. The Gray frame after the last step leaks too and shifts the phase somewhat more.
    let (valid, both, worst) = compared(&sound, &leaking, 250..270);
    // Steps that leak into each other leave a residual, which rejects one pixel in a thousand.
    assert!(
        500 * (valid - both) <= valid && worst > 0.28 && worst < 0.6,
        "{both} of {valid}, {worst}"
    );
    let (valid, both, _) = compared(&sound, &leaking, 365..385);
    assert!(valid > 5000 && 2 * both < valid, "{both} of {valid}");
    let uncertain = |decoded: &Decoded| {
        let verdicts = &decoded.x.as_ref().unwrap().verdict;
        verdicts
            .iter()
            .filter(|v| **v == Verdict::Uncertain)
            .count()
    };
    assert!(uncertain(&sound) < 50 && uncertain(&leaking) > 3000);

    let shortest = scan(&profile, 12_000);
    let message = check(&shortest).unwrap_err().to_string();
    assert!(message.contains("contradict each other"), "{message}");
}
