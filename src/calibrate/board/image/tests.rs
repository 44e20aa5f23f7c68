use super::BoardImage;
use phasmid_geometry::NoiseModel;
use phasmid_pattern::{Axis, Image, Manifest, ManifestFrame, Pattern, ProjectorSize};
use std::f64::consts::TAU;

const NOISE: NoiseModel = NoiseModel {
    gain_dn_per_e: 0.5,
    read_noise_dn: 2.0,
    black_level_dn: 100.0,
    saturation_dn: 60_000.0,
};
const WIDTH: usize = 64;

fn manifest(patterns: Vec<Pattern>) -> Manifest {
    let frame = patterns.into_iter().map(|pattern| ManifestFrame {
        file: None,
        pattern,
    });
    Manifest {
        projector: ProjectorSize {
            width_px: 256,
            height_px: 64,
        },
        frame: frame.collect(),
    }
}

fn fringe(phase_rad: f64) -> Pattern {
    Pattern::Fringe {
        axis: Axis::X,
        period_px: 16.0,
        phase_rad,
    }
}

fn gray(bit: u32, inverted: bool) -> Pattern {
    Pattern::Gray {
        axis: Axis::X,
        cell_px: 8.0,
        bits: 5,
        bit,
        inverted,
    }
}

/// 16-bit frames of a wall with 20,000 DN under white and 1,000 DN under black; adjacent camera
/// pixels are 2.7 projector pixels apart.
fn render(manifest: &Manifest) -> Vec<Vec<u16>> {
    let level = |pattern: &Pattern, x: f64| match *pattern {
        Pattern::Fringe {
            period_px,
            phase_rad,
            ..
        } => 0.5 + 0.5 * (TAU * x / period_px + phase_rad).cos(),
        _ => pattern.level(x as u32).unwrap_or(0.0),
    };
    let frames = manifest.frame.iter().map(|frame| {
        let row = (0..WIDTH).map(|i| 1100.0 + 19_000.0 * level(&frame.pattern, 2.7 * i as f64));
        row.map(|v| v.round() as u16).collect()
    });
    frames.collect()
}

fn image(manifest: &Manifest, frames: &[Vec<u16>]) -> phasmid_core::error::Result<BoardImage> {
    let images = frames
        .iter()
        .map(|f| Image::new(f.len(), 1, f.clone()).unwrap());
    BoardImage::from_frames(manifest, &images.collect::<Vec<_>>(), &NOISE)
}

#[test]
fn board_image_has_no_trace_of_the_patterns() {
    let equal: Vec<f64> = (0..12).map(|i| TAU * f64::from(i) / 12.0).collect();
    let uneven = vec![0.0, 0.9, 2.2, 3.1, 5.5];
    for phases in [equal, uneven, vec![0.0, TAU / 3.0, 2.0 * TAU / 3.0]] {
        let mut patterns: Vec<Pattern> = phases.into_iter().map(fringe).collect();
        // Bit 0 has no complement and must be left out; bit 2 has one and is used.
        patterns.extend([gray(0, false), gray(2, false), gray(2, true)]);
        patterns.extend([Pattern::White {}, Pattern::Black {}]);
        let manifest = manifest(patterns);
        let image = image(&manifest, &render(&manifest)).unwrap();
        let mean = image.level.iter().sum::<f32>() / WIDTH as f32;
        assert!((10_500.0..20_000.0).contains(&mean), "{mean}");
        // Rounding to integers is the only error left.
        for v in &image.level {
            assert!((v - mean).abs() < 1.0, "{v} {mean}");
        }
    }
}

#[test]
fn single_photograph_is_used_with_black_subtracted() {
    let manifest = manifest(vec![Pattern::White {}]);
    let mut frames = render(&manifest);
    frames[0][7] = 60_000;
    let image = image(&manifest, &frames).unwrap();
    assert_eq!(image.level[3], 20_000.0);
    let variance = NOISE.variance_dn2(20_100.0) as f32;
    assert!((image.variance[3] / variance - 1.0).abs() < 1e-6);
    assert!(image.level[7].is_nan() && !image.level[8].is_nan());
}

#[test]
fn variance_is_that_of_the_weighted_sum_and_near_the_least() {
    let phases = (0..4).map(|i| fringe(TAU * f64::from(i) / 4.0));
    let manifest = manifest(
        phases
            .chain([Pattern::White {}, Pattern::Black {}])
            .collect(),
    );
    let image = image(&manifest, &render(&manifest)).unwrap();
    // Signal and effective number of samples of three groups: white, the fringes' mean, and black.
    // In the best possible combination, signal^2 / variance equals the sum of signal^2 / variance
    // over the groups.
    let groups = [(20_000.0, 1.0), (10_500.0, 4.0), (1_000.0, 1.0)];
    let variance = |s: f64, n: f64| NOISE.variance_dn2(s + 100.0) / n;
    let best: f64 = groups.iter().map(|&(s, n)| s * s / variance(s, n)).sum();
    let ratio = f64::from(image.level[9]).powi(2) / f64::from(image.variance[9]);
    assert!((ratio / best - 1.0).abs() < 1e-3, "{ratio} {best}");
}

#[test]
fn refuses_frames_that_show_no_board() {
    let speckle = Pattern::Image {
        file: "speckle.png".into(),
    };
    for patterns in [
        vec![fringe(0.0), fringe(2.0)],
        vec![gray(1, false), gray(2, true)],
        vec![speckle],
    ] {
        let manifest = manifest(patterns);
        let message = image(&manifest, &render(&manifest))
            .unwrap_err()
            .to_string();
        assert!(message.contains("no frame that shows a board"), "{message}");
    }
    let white = manifest(vec![Pattern::White {}]);
    let message = image(&white, &[vec![60_000; WIDTH]])
        .unwrap_err()
        .to_string();
    assert!(message.contains("every pixel at 60000"), "{message}");
    let two = manifest(vec![Pattern::White {}, Pattern::White {}]);
    let message = image(&two, &render(&white)).unwrap_err().to_string();
    assert!(message.contains("1 frames"), "{message}");
}
