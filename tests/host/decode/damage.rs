//! Captures in which one frame has damaged pixels.

use crate::decode::patterns::*;
use crate::decode::scene::*;
use phasmid::decode::{Decoded, Decoder, Verdict};
use phasmid::pattern::{Axis, Image, Manifest};
use std::f64::consts::TAU;

/// Error in projector pixels above which a coordinate is wrong: more than noise, and about 1 mm on
/// the bench.
const WRONG_PX: f64 = 2.0;
/// Number of damaged pixels in a frame, no two of which are adjacent.
const DAMAGED: usize = 150;

fn capture(steps: usize) -> Manifest {
    let phases: Vec<f64> = (0..steps).map(|i| TAU * i as f64 / steps as f64).collect();
    manifest(
        [
            fringes(Axis::X, 16.0, &phases),
            gray(Axis::X, 16.0, 0..7, false),
            gray(Axis::X, 8.0, 0..1, false),
            references(),
        ]
        .concat(),
    )
}

fn decode(scene: &Scene, manifest: &Manifest, frames: &[Vec<u8>]) -> Decoded {
    let height = frames[0].len() / WIDTH;
    let decoder = Decoder::new(manifest, WIDTH, height, None, scene.options()).unwrap();
    let images: Vec<_> = frames
        .iter()
        .map(|f| Image::new(WIDTH, height, f.clone()).unwrap())
        .collect();
    decoder.decode(&images).unwrap()
}

/// Returns the number of wrongly decoded pixels and the number of pixels rejected as contradictory.
fn wrong(decoded: &Decoded, positions: &[[f64; 2]]) -> (usize, usize) {
    let map = decoded.axis(Axis::X).unwrap();
    let off = |(x, p): &(&f32, &[f64; 2])| (f64::from(**x) - p[0]).abs() > WRONG_PX;
    let wrong = map.coordinate.iter().zip(positions).filter(off).count();
    let odd = map.verdict.iter().filter(|v| **v == Verdict::Odd).count();
    (wrong, odd)
}

/// If every bit of the damaged pixels of every frame is flipped in turn, no coordinate is wrong,
/// with one exception: a Gray bit flipped where another bit is on its edge. The mirrored edge fits
/// the phase equally well there, and only neighbours can reveal the error, unless they are damaged
/// themselves.
#[test]
fn flipped_bits_make_no_wrong_coordinates() {
    let scene = Scene::default();
    let positions = sweep(24);
    for steps in [4, 5, 12] {
        let manifest = capture(steps);
        let sound = scene.frames_u8(&manifest, &positions);
        let (before, odd) = wrong(&decode(&scene, &manifest, &sound), &positions);
        // In a normal distribution, 6 of 100,000 values lie beyond four standard deviations.
        assert_eq!(before, 0, "{steps} steps");
        assert!(odd * 2000 <= positions.len(), "{steps} steps: {odd}");
        let (mut left, mut refused) = (0, 0);
        for k in 0..sound.len() {
            for bit in 0..8 {
                let mut frames = sound.clone();
                for j in 0..DAMAGED {
                    let draw = uniform((k * 8 + bit) as u64 * 1000 + j as u64);
                    frames[k][(draw * positions.len() as f64) as usize] ^= 1 << bit;
                }
                let (now, odd) = wrong(&decode(&scene, &manifest, &frames), &positions);
                left += now;
                refused += odd;
            }
        }
        let all = sound.len() * 8 * DAMAGED;
        println!("{steps} steps: {left} wrong and {refused} contradictory of {all} flipped bits");
        assert!(left <= all / 1000, "{steps} steps: {left} of {all}");
        assert!(refused > all / 20, "{steps} steps: {refused} of {all}");
    }
}

/// With three periods of three steps, all sets have the same mean. A flipped bit that moves the
/// phase is therefore detected, except for the lower bits, which move the phase by only a few times
/// the noise.
#[test]
fn flipped_bits_of_three_steps_are_refused() {
    let scene = Scene::default();
    let positions = sweep(24);
    let phases: Vec<f64> = (0..3).map(|i| TAU * f64::from(i) / 3.0).collect();
    let sets = [20.0, 192.0, 1920.0].map(|period| fringes(Axis::X, period, &phases));
    let manifest = manifest(sets.concat());
    let sound = scene.frames_u8(&manifest, &positions);
    let (before, odd) = wrong(&decode(&scene, &manifest, &sound), &positions);
    assert_eq!(before, 0);
    assert!(odd * 2000 <= positions.len(), "{odd}");
    for k in 0..sound.len() {
        for bit in 5..8 {
            let mut frames = sound.clone();
            let mut struck = vec![false; positions.len()];
            for j in 0..DAMAGED {
                let draw = uniform((k * 8 + bit) as u64 * 1000 + j as u64);
                let at = (draw * positions.len() as f64) as usize;
                frames[k][at] ^= u8::from(!struck[at]) << bit;
                struck[at] = true;
            }
            let decoded = decode(&scene, &manifest, &frames);
            let map = decoded.axis(Axis::X).unwrap();
            let left = |(i, _): &(usize, &bool)| map.verdict[*i] == Verdict::Valid;
            let damaged = struck.iter().enumerate().filter(|(_, struck)| **struck);
            let left = damaged.filter(left).count();
            assert_eq!(left, 0, "frame {k}, bit {bit}");
        }
    }
}

/// A response curve and flickering light leave residuals in every pixel; these residuals are then
/// normal and not damage.
#[test]
fn curved_responses_and_flicker_are_not_damage() {
    let positions = sweep(100);
    for seed in 1..3 {
        let scene = Scene {
            seed,
            ..Scene::default()
        };
        let still = Scene {
            noise: 0.0,
            ..scene
        };
        for steps in [3, 4, 5, 6, 12] {
            let manifest = capture(steps);
            let bent = manifest.frame.iter().enumerate().map(|(k, frame)| {
                let flicker = 1.0 + 0.01 * normal(1 << 40 | seed << 20 | k as u64);
                // The camera adds noise after the response curve.
                let values = still.frame(k, &frame.pattern, &positions);
                let value = |(i, v): (usize, &f64)| {
                    let linear = ((v - scene.floor) / scene.swing).clamp(0.0, 1.0);
                    let noise = scene.noise * normal(seed << 48 | (k as u64) << 32 | i as u64);
                    let v = scene.floor + flicker * scene.swing * linear.powf(2.2) + noise;
                    v.round().clamp(0.0, 255.0) as u8
                };
                values.iter().enumerate().map(value).collect()
            });
            let bent: Vec<Vec<u8>> = bent.collect();
            let (_, odd) = wrong(&decode(&scene, &manifest, &bent), &positions);
            println!("{steps} steps: {odd} contradictory of {}", positions.len());
            assert!(odd * 10_000 <= positions.len(), "{steps} steps: {odd}");
            if steps == 3 {
                assert_eq!(odd, 0);
            }
        }
    }
}
