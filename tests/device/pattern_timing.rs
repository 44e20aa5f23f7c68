//! A projector with pattern timing, tested through the whole device: allowed profiles, and the
//! frames of a scan.

use phasmid::decode::{Decoded, Decoder, Options, Verdict};
use phasmid::emulator::{Device, Firmware, MemorySink, Renderer, Shot, Truth};
use phasmid::pattern::Image;
use phasmid::profile::{Profile, Scene};
use std::sync::Arc;

const EVM: &str = include_str!("../../device-profiles/dlp-evm.toml");

/// Contradictory lines of a profile are rejected with the name of the field.
#[test]
fn contradictory_timing_is_refused_by_field() {
    for (line, instead, field, words) in [
        (
            "margin_us = 230.0 ",
            "margin_us = 230.5 ",
            "projector.timing.margin_us",
            "whole multiples of 1 us",
        ),
        (
            "load_us = 200000.0",
            "load_us = -1.0",
            "projector.timing.load_us",
            "0 to 60000000",
        ),
        (
            "resolution_us = 1.0",
            "resolution_us = 0.0015",
            "projector.timing.resolution_us",
            "whole nanoseconds",
        ),
        (
            "resolution_us = 1.0",
            "resolution_us = 0.0",
            "projector.timing.resolution_us",
            "0.001 to",
        ),
        (
            "[235.0, 700.0",
            "[701.0, 700.0",
            "projector.timing.min_exposure_us",
            "none shorter than",
        ),
        (
            "[235.0, 700.0",
            "[0.0, 700.0",
            "projector.timing.min_exposure_us",
            "times above 0",
        ),
        ("4500.0, 8333.0]", "4500.0]", "", "8"),
        (
            "exposure_us = 8500.0                 # ours\n",
            "exposure_us = 9800.0\n",
            "sequence[0].period_us",
            "shorter by 230 us",
        ),
        (
            "exposure_us = 8500.0                 # ours\n",
            "exposure_us = 8000.0\n",
            "sequence[0].period_us",
            "8333 us or more",
        ),
        (
            "exposure_us = 8500.0                 # ours\n",
            "exposure_us = 9700.0\ndark_before_us = 301.0\n",
            "sequence[0].period_us",
            "the period of 10000 us",
        ),
        (
            "period_us = 10000.0",
            "period_us = 10000.5",
            "sequence[0].period_us",
            "whole multiples",
        ),
        (
            "bit_planes = true",
            "camera_delay_us = 10000.0\nbit_planes = true",
            "projector.timing.camera_delay_us",
            "less than",
        ),
        (
            "[projector.timing]",
            "response = { gamma = 2.2 }\n[projector.timing]",
            "projector.timing.bit_planes",
            "one of them",
        ),
        (
            "readout_us = 1200.0",
            "readout_us = 1600.0",
            "sequence[0].period_us",
            "10100",
        ),
        (
            "readout_us = 1200.0",
            "line_time_us = 5.0\nreadout_us = 1200.0",
            "camera.readout_us",
            "one of them",
        ),
        (
            "shortest_interval_us = 4000.0",
            "shortest_interval_us = 30000.0",
            "camera.frame_interval_us",
            "30000",
        ),
        ("bit_planes = true", "planes = true", "", "planes"),
    ] {
        assert!(EVM.contains(line), "{line}");
        let text = EVM.replacen(line, instead, 1);
        let message = Profile::parse(&text, "file.toml").unwrap_err().to_string();
        assert!(message.starts_with("file.toml:"), "{message}");
        assert!(
            message.contains(field) && message.contains(words),
            "{instead}: {message}"
        );
    }
    // Each of these changes is valid without the others.
    for instead in [
        "",
        "dark_before_us = 171.0\ndark_after_us = 31.0\n",
        "resolution_us = 0.5\n",
    ] {
        let text = EVM.replacen("resolution_us = 1.0", instead, 1);
        assert!(Profile::parse(&text, "file.toml").is_ok(), "{instead}");
    }
}

struct Seen {
    decoded: Decoded,
    truth: Truth,
}

/// Returns the profile of the built-in projector module, without the data line that identifies
/// frames.
fn evm() -> Profile {
    let mut profile = Profile::load("dlp-evm").unwrap();
    profile.camera.data_line = false;
    profile
}

/// Scans the plane with the profile's first sequence.
fn scan(profile: &Profile, commands: &str) -> Seen {
    let scene = Scene::load("plane").unwrap();
    let device = Device::builder(profile, &scene).seed(1).build().unwrap();
    let mut bench = device.bench(MemorySink::default());
    let line = format!("TRIG:SOUR BUS;:{commands};:INIT;*TRG;*OPC?;:TRIG:MISS?;:SYST:ERR?\n");
    assert_eq!(bench.control(line.as_bytes()), b"1;0;0,\"No error\"\n");
    let sequence = bench.firmware().selected_sequence();
    let manifest = profile.manifest(&profile.sequence[0]);
    let frames: Vec<_> = bench.sink.frames.iter().collect();
    let (w, h) = (frames[0].width as usize, frames[0].height as usize);
    let images: Vec<_> = frames
        .iter()
        .map(|f| Image::new(w, h, f.data.clone()).unwrap())
        .collect();
    let decoder = Decoder::new(&manifest, w, h, None, Options::default()).unwrap();
    Seen {
        decoded: decoder.decode(&images).unwrap(),
        truth: bench.into_device().renderer.truth(&sequence),
    }
}

/// Returns the fraction of the lit pixels that were decoded, and the RMS error of the decoded pixels
/// in projector pixels.
fn error_px(seen: &Seen) -> (f64, f64) {
    let maps = seen.decoded.x.as_ref().unwrap();
    let truth = &seen.truth;
    let lit = (0..truth.flags.len()).filter(|&i| truth.flags[i] & Truth::LIT != 0);
    let (mut all, mut good, mut sum) = (0, 0, 0.0);
    for i in lit {
        all += 1;
        if maps.verdict[i] == Verdict::Valid {
            good += 1;
            sum += f64::from(maps.coordinate[i] - truth.projector_x[i]).powi(2);
        }
    }
    (
        f64::from(good) / f64::from(all),
        (sum / f64::from(good)).sqrt(),
    )
}

#[test]
fn a_scan_decodes_as_well_as_its_noise_allows() {
    let seen = scan(&evm(), "SEQ:SEL 'evm-4'");
    let (coverage, error) = error_px(&seen);
    assert!(coverage > 0.97, "{coverage}");
    assert!(error < 0.05, "{error} px");
}

/// In half of a pattern's time, the projector shows the lower seven bits and almost none of the
/// highest bit. The frame is the sum of the bit planes, each weighted by its fraction of the
/// exposure: bit k lasts 2^k / 255 of the pattern.
#[test]
fn half_of_a_pattern_shows_the_sum_of_its_bits() {
    let mut profile = evm();
    profile.camera.sensor.noiseless = true;
    let mut renderer = Renderer::new(&profile, &Scene::load("plane").unwrap(), 1).unwrap();
    let mut firmware = Firmware::new(&profile, &[]).unwrap();
    let mut shots = |exposure: &str| {
        firmware.receive(format!("CAM:EXP {exposure}\n").as_bytes(), 0);
        let sequence = firmware.selected_sequence();
        [0, 11, 12].map(|place| sequence[place].1.clone())
    };
    let whole = shots("8500us");
    let half = shots("4250us");
    assert!(whole.iter().all(|shot| shot.then.is_empty()));
    let black = renderer.expected_dn(&half[2]);
    // A white pattern is white from its start, so half its duration gives half the brightness.
    let (white, all_white) = (
        renderer.expected_dn(&half[1]),
        renderer.expected_dn(&whole[1]),
    );
    for i in (0..white.len()).step_by(97) {
        let (part, all) = (white[i] - black[i], all_white[i] - black[i]);
        assert!((part - all / 2.0).abs() < 1e-3, "{part} of {all}");
    }
    let fringe = whole[0].pattern_image.clone().unwrap();
    let mut expected = black.clone();
    for bit in 0..8 {
        let lasts_us = f64::from(1 << bit) / 255.0 * 8500.0;
        let begins_us = f64::from((1 << bit) - 1) / 255.0 * 8500.0;
        let share = ((begins_us + lasts_us).min(4250.0) - begins_us) / 4250.0;
        let plane = Shot {
            pattern_image: Some(Arc::new(fringe.plane(bit, 8))),
            then: Vec::new(),
            ..half[0].clone()
        };
        let alone = renderer.expected_dn(&plane);
        for (sum, (alone, black)) in expected.iter_mut().zip(alone.iter().zip(&black)) {
            *sum += share as f32 * (alone - black);
        }
    }
    let seen = renderer.expected_dn(&half[0]);
    let worst = seen.iter().zip(&expected).map(|(a, b)| (a - b).abs());
    let worst = worst.fold(0.0, f32::max);
    // Bits start at whole nanoseconds, which rounds them by up to 2e-7 of the exposure.
    assert!(worst < 2e-3, "{worst} DN");
    // The host cannot decode fringes from such frames.
    let (_, well) = error_px(&scan(&evm(), "CAM:EXP 8500us"));
    let (coverage, badly) = error_px(&scan(&evm(), "CAM:EXP 4250us"));
    assert!(
        coverage < 0.5 || badly > 5.0 * well,
        "{coverage} {badly} {well}"
    );
}
