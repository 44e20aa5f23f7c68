//! Light source with a rise time and warm-up that shines for only a part of an exposure: frames are
//! compared with closed forms.

use phasmid::emulator::led::{Model, Source};
use phasmid::emulator::render::{Renderer, Term};
use phasmid::emulator::{Bench, Device, MemorySink, PatternImage, Shot, Showing, Shutter};
use phasmid::pattern::{Axis, Pattern};
use phasmid::profile::{Droop, Led, Profile, Scene};
use phasmid::protocol::Frame;
use std::sync::Arc;

const MS: u64 = 1_000_000;

const LIT: &str = "name = \"lit\"\ndescription = \"\"\nambient = { irradiance_w_m2 = 0.05 }\n[[object]]\nshape = { kind = \"plane\" }\n\
    position_mm = [0, 0, 1000]\nalbedo = 0.7\n";

fn led(rise_us: f64, droop: &[(f64, f64)]) -> Led {
    let droop = droop.iter().map(|&(time_constant_s, fraction)| Droop {
        time_constant_s,
        fraction,
    });
    Led {
        rise_us,
        droop: droop.collect(),
    }
}

/// Returns a profile with a small camera without noise and data line, and with this light source
/// model.
fn small(source: Option<Led>) -> Profile {
    let mut profile = Profile::load("webcam-grey").unwrap();
    let camera = &mut profile.camera;
    camera.sensor_width_mm /= 4.0;
    (camera.width_px, camera.height_px) = (160, 120);
    camera.data_line = false;
    camera.sensor.noiseless = true;
    profile.projector.led = source;
    profile
}

fn fringe(profile: &Profile, axis: Axis) -> Arc<PatternImage> {
    let pattern = Pattern::Fringe {
        axis,
        period_px: 24.0,
        phase_rad: 0.4,
    };
    Arc::new(PatternImage::new(&pattern, &profile.projector, &|_| unreachable!()).unwrap())
}

/// Returns the signal, in some row, of a plane lit by white, relative to full light.
fn light(renderer: &mut Renderer, shot: &Shot, row: usize) -> f64 {
    let mut pixel = |light: Option<f64>| {
        let shot = match light {
            None => shot.clone(),
            Some(light) => Shot {
                light,
                then: Vec::new(),
                emission: None,
                ..shot.clone()
            },
        };
        f64::from(renderer.expected_dn(&shot)[row * 160 + 80])
    };
    let [dark, full] = [0.0, 0.5].map(|light| pixel(Some(light)));
    0.5 * (pixel(None) - dark) / (full - dark)
}

#[test]
fn frame_is_the_mean_of_the_patterns_shown() {
    let profile = small(Some(led(1.0, &[])));
    let scene = Scene::load("sphere").unwrap();
    let mut renderer = Renderer::new(&profile, &scene, 1).unwrap();
    assert!(renderer.plan().has(Term::PatternTiming));
    let start_ns = 7_000 * MS;
    let show = |at_ms, pattern_image, light| Showing {
        from_ns: start_ns + at_ms * MS,
        pattern_image,
        light,
    };
    let [x, y] = [Axis::X, Axis::Y].map(|axis| fringe(&profile, axis));
    let shot = Shot {
        light: 1.0,
        then: vec![
            show(1, Some(x.clone()), 0.9),
            show(4, None, 1.0),
            show(5, Some(y.clone()), 0.5),
            show(9, None, 1.0),
        ],
        start_ns,
        exposure_ns: 10 * MS,
        ..Shot::default()
    };
    let found = renderer.expected_dn(&shot);
    let mut alone = |pattern_image: Option<&Arc<PatternImage>>, light| {
        renderer.expected_dn(&Shot {
            pattern_image: pattern_image.cloned(),
            light,
            then: Vec::new(),
            ..shot.clone()
        })
    };
    let parts = [
        (0.3, alone(None, 1.0)),
        (0.3, alone(Some(&x), 0.9)),
        (0.4, alone(Some(&y), 0.5)),
    ];
    for (i, &dn) in found.iter().enumerate() {
        let exact: f64 = parts.iter().map(|(w, dn)| w * f64::from(dn[i])).sum();
        assert!(
            exact < 254.0 && (f64::from(dn) - exact).abs() < 1e-3,
            "{i}: {dn} {exact}"
        );
    }
    // Patterns that are shown outside the exposure are not seen.
    let later = Shot {
        start_ns: start_ns + 20 * MS,
        ..shot.clone()
    };
    assert!(renderer.expected_dn(&later) == parts[0].1);
    // With the term disabled, only the first pattern image of the shot is seen.
    renderer.force(Term::PatternTiming, false);
    assert!(renderer.expected_dn(&shot) == parts[0].1);
}

#[test]
fn frames_see_the_source_rise_and_fade() {
    let source = led(2000.0, &[(0.05, 0.2), (3.0, 0.3)]);
    let mut profile = small(Some(source.clone()));
    profile.camera.line_time_us = 100.0;
    let mut renderer = Renderer::new(&profile, &Scene::parse(LIT, "lit").unwrap(), 1).unwrap();
    let mut driven = Source::new(Model::new(&source));
    driven.drive(10 * MS, 1.0);
    driven.drive(14 * MS, 0.3);
    let emission = driven.emission(0);
    for (start_ms, line_time_ns) in [(8, 0), (11, 0), (8, 100_000), (5000, 100_000)] {
        let shot = Shot {
            pattern_image: Some(Arc::new(PatternImage::Uniform(255))),
            light: 1.0,
            emission: Some(emission.clone()),
            start_ns: start_ms * MS,
            exposure_ns: 4 * MS,
            shutter: Shutter {
                line_time_ns,
                first_row: 0,
                rows: 120,
            },
            ..Shot::default()
        };
        for row in [0, 7, 60, 119] {
            let from = shot.row_start_ns(row as u32);
            let exact = emission.mean(from, from + 4 * MS);
            let found = light(&mut renderer, &shot, row);
            assert!(
                (found - exact).abs() < 2e-5,
                "{start_ms} ms, {row}: {found} {exact}"
            );
        }
    }
}

/// Returns the frames, up to `end_ms`, of a device that receives these command lines at these times
/// in milliseconds.
fn frames(profile: &Profile, lines: &[(u64, &str)], end_ms: u64) -> Vec<Frame> {
    let mut bench = Device::builder(profile, &Scene::parse(LIT, "lit").unwrap())
        .seed(1)
        .build()
        .unwrap()
        .bench(MemorySink::default());
    bench.firmware().set_streaming(true, 0);
    // A camera that is not polled for more than a second skips frames.
    let wait = |bench: &mut Bench<MemorySink>, until_ms: u64| {
        while bench.now_ns() < until_ms * MS {
            let next_ns = bench.now_ns() + 500 * MS;
            bench.run_until(next_ns.min(until_ms * MS));
        }
    };
    for (at_ms, line) in lines {
        wait(&mut bench, *at_ms);
        let now_ns = bench.now_ns();
        bench
            .device_mut()
            .machine
            .receive(format!("{line}\n").as_bytes(), now_ns);
        bench.run_until(now_ns);
    }
    wait(&mut bench, end_ms);
    let now_ns = bench.now_ns();
    assert_eq!(bench.device_mut().machine.take_output(now_ns), b"");
    bench.sink.frames.iter().map(|f| (**f).clone()).collect()
}

fn brightness(frame: &Frame) -> f64 {
    let sum: f64 = frame.data.iter().map(|&dn| f64::from(dn)).sum();
    sum / frame.data.len() as f64
}

/// An LED with neither rise time nor warm-up gives exactly the frames of a projector without an LED
/// model.
#[test]
fn ideal_source_changes_no_byte() {
    let lines = [
        (0, "TRIG:SOUR BUS;:INIT"),
        (100, "*TRG"),
        (2000, "INIT;*TRG"),
    ];
    let plain = frames(&small(None), &lines, 4000);
    assert!(plain.len() > 20);
    assert!(frames(&small(Some(led(1.0, &[(10.0, 0.0)]))), &lines, 4000) == plain);
}

/// With a free-running camera, the light depends on the lamp's state and current and on the history
/// of both, all in device time.
#[test]
fn light_follows_lamp_commands_in_device_time() {
    let source = led(5.0, &[(1.5, 0.3)]);
    let lines = [
        (2006, "PROJ:POW OFF"),
        (2600, "PROJ:POW ON"),
        (3010, "PROJ:CURR 0.5"),
    ];
    let found = frames(&small(Some(source.clone())), &lines, 3500);
    assert!(found == frames(&small(Some(source.clone())), &lines, 3500));
    let full = brightness(&frames(&small(None), &[], 100)[0]);
    let dark = brightness(&frames(&small(None), &[(0, "PROJ:POW OFF")], 100)[0]);
    assert!(full > dark + 60.0 && full < 250.0, "{full} {dark}");
    let mut driven = Source::new(Model::new(&source));
    for (at_ms, level) in [(0, 1.0), (2006, 0.0), (2600, 1.0), (3010, 0.5)] {
        driven.drive(at_ms * MS, level);
    }
    let emission = driven.emission(0);
    assert!(found.len() > 90);
    let mut partly = 0;
    for frame in &found {
        let (start_ns, end_ns) = (frame.exposure_start_ns, frame.exposure_end_ns);
        let exact = emission.mean(start_ns, end_ns);
        let found = (brightness(frame) - dark) / (full - dark);
        assert!((found - exact).abs() < 0.008, "{start_ns}: {found} {exact}");
        partly += u32::from(start_ns < 2006 * MS && end_ns > 2006 * MS && found > 0.1);
    }
    assert_eq!(partly, 1, "one exposure sees the lamp go off");
}

/// A projector with pattern timing lights its source only while it shows patterns. The source stays
/// cooler than a source that is always on, and each frame sees the corresponding light.
#[test]
fn source_is_lit_only_while_patterns_are_shown() {
    let source = led(30.0, &[(0.2, 0.4)]);
    let mut profile = Profile::load("dlp-evm").unwrap();
    profile.camera.data_line = false;
    profile.camera.sensor.noiseless = true;
    let scan = [(0, "TRIG:SOUR BUS;:INIT"), (3000, "*TRG")];
    let plain = frames(&profile, &scan, 9000);
    profile.projector.led = Some(source.clone());
    let faded = frames(&profile, &scan, 9000);
    assert_eq!(plain.len(), profile.sequence[0].frame.len());
    assert_eq!(faded.len(), plain.len());
    let timing = profile.projector.timing.clone().unwrap();
    let ns = |us: f64| (us * 1e3).round() as u64;
    let period_ns = ns(profile.sequence[0].period_us);
    let mut driven = Source::new(Model::new(&source));
    driven.drive(0, 1.0);
    let first_ns = plain[0].exposure_start_ns;
    let delay_ns = ns(timing.camera_delay_us.unwrap_or(timing.dark_before_us));
    for i in 0..plain.len() as u64 {
        let begins_ns = first_ns - delay_ns + i * period_ns;
        let lit_ns = begins_ns + ns(timing.dark_before_us);
        driven.open(begins_ns, false);
        driven.open(lit_ns, true);
        driven.open(lit_ns + ns(timing.exposure_us.unwrap()), false);
    }
    let emission = driven.emission(0);
    let mut last = 0.0;
    let black = plain.last().unwrap();
    for (plain, faded) in plain.iter().zip(&faded) {
        let start_ns = plain.exposure_start_ns;
        assert_eq!(faded.exposure_start_ns, start_ns);
        let lit_ns = start_ns - delay_ns + ns(timing.dark_before_us);
        let exact = emission.mean(lit_ns, lit_ns + ns(timing.exposure_us.unwrap()));
        assert!(exact > last && exact < 0.9, "cools in the dark: {exact}");
        last = exact;
        let bright = |frame: &Frame| brightness(frame) - brightness(black);
        if bright(plain) > 20.0 {
            let found = bright(faded) / bright(plain);
            assert!((found - exact).abs() < 0.03, "{found} {exact}");
        }
    }
}
