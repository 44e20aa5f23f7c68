//! The checks on synthetic captures of a bent, textured surface.

use super::*;
use phasmid_pattern::Pattern;
use std::f64::consts::TAU;

const SIZE: (usize, usize) = (200, 120);

/// Deterministic noise with a standard deviation of 1.
fn noise(seed: usize) -> f64 {
    let draw = |k: u64| {
        let mut v = (seed as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ k << 40;
        v = (v ^ v >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        v = (v ^ v >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        (v >> 40) as f64 / f64::from(1u32 << 24)
    };
    // The sum of twelve uniform numbers.
    (0..12).map(draw).sum::<f64>() - 6.0
}

/// Returns the level of a pattern at a position between pixels.
fn level(pattern: &Pattern, x: f64) -> f64 {
    match pattern {
        Pattern::Fringe {
            period_px,
            phase_rad,
            ..
        } => 0.5 + 0.45 * (TAU * x / period_px + phase_rad).cos(),
        _ => pattern.level(x.round() as u32).unwrap(),
    }
}

/// Renders a capture of a sequence; `bend` maps the levels, as a response curve does.
fn captured(patterns: &str, bend: impl Fn(f64) -> f64) -> (Manifest, Vec<Image>) {
    let text = format!("[projector]\nwidth_px = 512\nheight_px = 384\n{patterns}");
    let manifest = Manifest::parse(&text, "test").unwrap();
    let (width, height) = SIZE;
    let frame = |(k, frame): (usize, &phasmid_pattern::ManifestFrame)| {
        let value = |i: usize| {
            let (u, v) = ((i % width) as f64, (i / width) as f64);
            let x = 40.0 + 1.9 * u + 6.0 * (v / 30.0).sin() + 0.05 * v;
            let albedo = 150.0 + 30.0 * (v / 17.0 + u / 23.0).sin();
            let level = bend(level(&frame.pattern, x));
            (12.0 + albedo * level + noise(i * 64 + k)).round() as u8
        };
        Image::new(
            width,
            height,
            (0..width * height).map(value).collect::<Vec<u8>>(),
        )
        .unwrap()
    };
    let frames = manifest.frame.iter().enumerate().map(frame).collect();
    (manifest, frames)
}

fn fringes(period_px: f64, steps: usize) -> String {
    let step = |k: usize| {
        let phase = TAU * k as f64 / steps as f64;
        format!(
            "[[frame]]\npattern = {{ kind = \"fringe\", axis = \"x\", period_px = {period_px}, \
             phase_rad = {phase} }}\n"
        )
    };
    (0..steps).map(step).collect()
}

/// Returns a sequence of four steps, a code of half periods, white and black: frames 0 to 3, 4 to 9, 10
/// and 11.
fn four_steps() -> String {
    let bits = (0..6).rev().map(|bit| {
        format!(
            "[[frame]]\npattern = {{ kind = \"gray\", axis = \"x\", cell_px = 8, bits = 6, bit = {bit} }}\n"
        )
    });
    let ends =
        ["white", "black"].map(|kind| format!("[[frame]]\npattern = {{ kind = \"{kind}\" }}\n"));
    fringes(16.0, 4) + &bits.collect::<String>() + &ends.concat()
}

/// Returns a sequence of three periods with three steps each.
fn three_sets() -> String {
    [10.0, 80.0, 640.0]
        .map(|period| fringes(period, 3))
        .concat()
}

fn found(patterns: &str, change: impl FnOnce(&mut Vec<Image>)) -> Result<(), FrameDoubt> {
    let (manifest, mut frames) = captured(patterns, |level| level);
    change(&mut frames);
    check_sequence(&manifest, &frames, Known::default())
}

fn samples(frame: &mut Image) -> &mut [u8] {
    frame.as_u8_mut().unwrap()
}

#[test]
fn sound_captures_pass() {
    for patterns in [four_steps(), three_sets()] {
        assert_eq!(found(&patterns, |_| {}), Ok(()));
        // A lamp that flickers by some percent is estimated, not flagged.
        let flicker = |frames: &mut Vec<Image>| {
            for (k, part) in [(0, 0.97), (1, 1.02), (2, 1.01)] {
                let dim = |v: &mut u8| *v = (12.0 + part * (f64::from(*v) - 12.0)).round() as u8;
                samples(&mut frames[k]).iter_mut().for_each(dim);
            }
        };
        assert_eq!(found(&patterns, flicker), Ok(()));
    }
}

#[test]
fn exchanged_frames_are_named() {
    for (one, other) in [(0, 1), (2, 3), (3, 4), (5, 6), (9, 10)] {
        let wanted = FrameDoubt::Exchanged {
            frames: [one, other],
        };
        let told = found(&four_steps(), |frames| frames.swap(one, other));
        assert_eq!(told, Err(wanted));
    }
}

#[test]
fn exchanged_bits_of_an_overexposed_code_with_complements_are_told() {
    let bit = |bit: usize, inverted: bool| {
        format!(
            "[[frame]]\npattern = {{ kind = \"gray\", axis = \"x\", cell_px = 8, bits = 6, bit = {bit}, inverted = {inverted} }}\n"
        )
    };
    let bits = [false, true].map(|inverted| (0..6).map(|i| bit(i, inverted)).collect::<String>());
    let ends =
        ["white", "black"].map(|kind| format!("[[frame]]\npattern = {{ kind = \"{kind}\" }}\n"));
    let (manifest, mut frames) = captured(&(bits.concat() + &ends.concat()), |level| 2.5 * level);
    assert_eq!(samples(&mut frames[12]).iter().min(), Some(&255));
    let checked = |frames: &[Image]| check_sequence(&manifest, frames, Known::default());
    assert_eq!(checked(&frames), Ok(()));
    frames.swap(1, 3);
    frames.swap(7, 9);
    assert!(checked(&frames).is_err());
    // The modulation of frames of different sizes is not checked.
    frames[3] = Image::new(10, 10, vec![0u8; 100]).unwrap();
    assert!(check_modulation(&manifest, &frames).is_ok());
}

#[test]
fn the_light_of_a_step_is_named() {
    for (patterns, steps) in [(four_steps(), 4), (three_sets(), 3)] {
        for frame in 0..steps {
            for part in [0.0, 0.5, 0.8] {
                let told = found(&patterns, |frames| {
                    let dim =
                        |v: &mut u8| *v = (12.0 + part * (f64::from(*v) - 12.0)).round() as u8;
                    samples(&mut frames[frame]).iter_mut().for_each(dim);
                });
                // With three steps, the scale of the residuals shows a step with far less light.
                if part < 0.6 && steps == 3 {
                    assert!(told.is_err(), "{part} of frame {frame}");
                    continue;
                }
                let Err(FrameDoubt::Light { frame: k, part: p }) = told else {
                    panic!("{steps} steps, {part} of frame {frame}: {told:?}");
                };
                assert!(
                    k == frame && (p - part).abs() < 0.08,
                    "{part} of {frame}: {p} of {k}"
                );
            }
        }
    }
}

#[test]
fn a_dark_step_is_told_if_little_is_lit() {
    for lit in [16, 40] {
        for (part, is_told) in [(1.0, false), (0.5, true), (0.0, true)] {
            let told = found(&four_steps(), |frames| {
                for (k, frame) in frames.iter_mut().enumerate() {
                    let part = if k == 3 { part } else { 1.0 };
                    for (i, v) in samples(frame).iter_mut().enumerate() {
                        let light = if i % SIZE.0 < lit {
                            f64::from(*v) - 12.0
                        } else {
                            0.0
                        };
                        *v = (12.0 + part * light + noise(i * 64 + k)).round() as u8;
                    }
                }
            });
            assert_eq!(told.is_err(), is_told, "{lit} columns, {part}: {told:?}");
        }
    }
}

#[test]
fn a_torn_frame_is_told_with_its_rows() {
    let row = 100;
    for torn in [0, 2, 6] {
        let told = found(&four_steps(), |frames| {
            let other = frames[torn + 1].as_u8().unwrap()[row * SIZE.0..].to_vec();
            samples(&mut frames[torn])[row * SIZE.0..].copy_from_slice(&other);
        });
        let Err(FrameDoubt::Contradictory {
            rows: Some(rows), ..
        }) = told
        else {
            panic!("{torn}: {told:?}");
        };
        assert!(*rows.start() + 2 >= row && *rows.end() > 110, "{rows:?}");
    }
}

#[test]
fn flipped_bits_are_told_from_a_hundredth_of_the_pixels_on() {
    for (patterns, frames) in [(four_steps(), 12), (three_sets(), 9)] {
        for k in (0..frames).filter(|k| *k < 10) {
            for (every, is_told) in [(2000, false), (50, true)] {
                let told = found(&patterns, |frames| {
                    samples(&mut frames[k])
                        .iter_mut()
                        .step_by(every)
                        .for_each(|v| *v ^= 128);
                });
                assert_eq!(
                    told.is_err(),
                    is_told,
                    "every {every}. pixel of {k}: {told:?}"
                );
            }
        }
    }
}

#[test]
fn fringes_that_a_response_curve_bends_are_doubted() {
    let (manifest, frames) = captured(&three_sets(), |level| level.powf(1.8));
    let told = doubt_of_fringes(&manifest, &frames, Known::default());
    assert!(
        matches!(told, Some(FrameDoubt::NotSinusoidal { .. })),
        "{told:?}"
    );
    let (manifest, frames) = captured(&three_sets(), |level| level);
    assert_eq!(doubt_of_fringes(&manifest, &frames, Known::default()), None);
}

#[test]
fn no_chance_in_ten_thousand_exceeds_the_limit() {
    // Sum of the upper tail of the binomial distribution with exactly this rate.
    for all in [100usize, 1000, 10_000, 25_000] {
        let mut term = (1.0 - RATE).powi(all as i32);
        let mut tail = 0.0;
        for odd in 0..all.min(400) {
            if is_too_many(Count { all, odd }, RATE) {
                tail += term;
            }
            term *= (all - odd) as f64 / (odd + 1) as f64 * RATE / (1.0 - RATE);
        }
        assert!(tail > 1e-9 && tail < 1e-4, "{all}: {tail:.2e}");
    }
}
