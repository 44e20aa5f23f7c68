//! The 22 frames of the bench profile, every pixel lit, to points: milliseconds, and the ratio to a
//! memory copy of the frames' bytes in the same run.

use glam::{DVec2, DVec3};
use phasma::decode::{Decoded, Decoder, FrameStack, Options, Samples};
use phasma::geometry::{Lens, NoiseModel, Pose, Rig, View};
use phasma::pattern::{Axis, Manifest, ManifestFrame, Pattern, ProjectorSize};
use std::f64::consts::TAU;
use std::hint::black_box;
use std::time::Instant;

const SIZE: (usize, usize) = (1138, 489);
const RUNS: usize = 60;

fn main() {
    let manifest = manifest();
    let rig = rig();
    let frames = frames(&manifest, &rig);
    let decoder = Decoder::new(&manifest, SIZE.0, SIZE.1, Some(&rig), Options::default()).unwrap();
    let samples = frames.iter().map(|f| Samples::U8(f)).collect();
    let stack = FrameStack::new(SIZE.0, SIZE.1, samples).unwrap();
    let (mut decoded, mut points) = (Decoded::default(), Vec::new());
    let mut copies: Vec<Vec<u8>> = frames.clone();
    let (mut decode_ms, mut copy_ms) = (Vec::new(), Vec::new());
    for _ in 0..RUNS {
        let start = Instant::now();
        for (copy, frame) in copies.iter_mut().zip(&frames) {
            copy.copy_from_slice(black_box(frame));
        }
        black_box(&copies);
        copy_ms.push(start.elapsed().as_secs_f64() * 1e3);
        let start = Instant::now();
        decoder.decode_into(&stack, &mut decoded).unwrap();
        decoder.points_into(&decoded, &mut points);
        black_box(&points);
        decode_ms.push(start.elapsed().as_secs_f64() * 1e3);
    }
    decode_ms.sort_by(f64::total_cmp);
    copy_ms.sort_by(f64::total_cmp);
    let (decode, copy) = (decode_ms[RUNS / 2], copy_ms[RUNS / 2]);
    println!(
        "decode 22 frames of {} x {} to {} points: {decode:.2} ms (least {:.2}), copy {copy:.3} ms, \
         ratio {:.1}, {} threads",
        SIZE.0,
        SIZE.1,
        points.len(),
        decode_ms[0],
        decode / copy,
        rayon::current_num_threads()
    );
}

fn manifest() -> Manifest {
    let fringes = (0..12).map(|i| Pattern::Fringe {
        axis: Axis::X,
        period_px: 16.0,
        phase_rad: TAU * f64::from(i) / 12.0,
    });
    let gray = |cell_px, bits, bit| Pattern::Gray {
        axis: Axis::X,
        cell_px,
        bits,
        bit,
        inverted: false,
    };
    let patterns = fringes
        .chain((0..7).rev().map(|bit| gray(16.0, 7, bit)))
        .chain([gray(8.0, 8, 0), Pattern::White {}, Pattern::Black {}]);
    Manifest {
        projector: ProjectorSize {
            width_px: 1920,
            height_px: 1080,
        },
        frame: patterns
            .map(|pattern| ManifestFrame {
                file: None,
                pattern,
            })
            .collect(),
    }
}

/// The bench's geometry, but with a field wide enough to light every pixel.
fn rig() -> Rig {
    let view = |width_px, height_px, focal, principal_px, x| View {
        lens: Lens {
            width_px,
            height_px,
            focal_px: DVec2::splat(focal),
            principal_px,
            distortion: [0.0; 5],
        },
        rig_from_view: Pose {
            translation_mm: DVec3::new(x, 0.0, 0.0),
            ..Pose::IDENTITY
        },
    };
    Rig {
        camera: view(1138, 489, 632.2, DVec2::new(568.5, 244.0), 0.0),
        projector: view(1920, 1080, 1000.0, DVec2::new(1360.0, 540.0), 400.0),
        noise: Some(NoiseModel {
            gain_dn_per_e: 0.02,
            read_noise_dn: 0.5,
            black_level_dn: 4.0,
            saturation_dn: 255.0,
        }),
    }
}

/// A wavy surface about 1 m away, with a little pseudo-random noise.
fn frames(manifest: &Manifest, rig: &Rig) -> Vec<Vec<u8>> {
    let mut state = 1u32;
    manifest
        .frame
        .iter()
        .map(|frame| {
            let mut pixels = Vec::with_capacity(SIZE.0 * SIZE.1);
            for v in 0..SIZE.1 {
                for u in 0..SIZE.0 {
                    let ray = rig.camera.ray(DVec2::new(u as f64, v as f64));
                    let z = 1000.0 + 20.0 * (u as f64 * 0.01).sin() * (v as f64 * 0.02).cos();
                    let x = rig.projector.project(ray * z).unwrap().x;
                    let level = match frame.pattern {
                        Pattern::Fringe { phase_rad, .. } => {
                            0.5 + 0.5 * (TAU * x / 16.0 + phase_rad).cos()
                        }
                        ref other => other.level((x + 0.5).max(0.0) as u32).unwrap(),
                    };
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    let noise = f64::from(state >> 16) / 65536.0 * 2.0 - 1.0;
                    pixels.push((20.0 + 200.0 * level + noise).round() as u8);
                }
            }
            pixels
        })
        .collect()
}
