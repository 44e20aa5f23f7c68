//! Compares the sensor pass of the GPU with the CPU's on whole frames.

use super::Engine;
use super::sensor::SensorPass;
use crate::sensor::{FixedPattern, Sensor, bloom};
use crate::{Plan, Term};
use phasmid_profile::{CameraResponse, Profile, Sensor as Parameters};

/// Odd image width, and a pixel count that is not a multiple of the word or workgroup size.
const SIZE: (usize, usize) = (333, 217);
const PIXELS: usize = SIZE.0 * SIZE.1;
const TERMS: [Term; 5] = [
    Term::DarkCurrent,
    Term::FixedPattern,
    Term::Blooming,
    Term::Noise,
    Term::CameraResponse,
];

/// Returns a sensor with all effects, whose converter saturates slightly below the full well.
fn sensor(bits: u32) -> Parameters {
    let full_well_e = 10_000.0;
    Parameters {
        full_well_e,
        read_noise_e: 2.3,
        gain_dn_per_e: f64::from((1u32 << bits) - 1) / (0.95 * full_well_e),
        black_level_dn: 4.0,
        bits,
        dark_current_e_s: 300.0,
        prnu_percent: 1.5,
        dsnu_e: 3.0,
        pattern_seed: 77,
        blooming_percent: 60.0,
        response: CameraResponse::Gamma { gamma: 2.2 },
        ..Profile::load("pmp-bench").unwrap().camera.sensor
    }
}

fn plan(terms: &[Term]) -> Plan {
    let mut plan = Plan::default();
    for &term in terms {
        plan.set(term, true);
    }
    plan
}

/// Returns means from 0 to beyond the full well, logarithmically spaced and with runs of equal
/// values.
fn electrons(full_well_e: f64) -> Vec<f32> {
    let mean = |i: usize| {
        let u = (i as u32).wrapping_mul(2_654_435_769) >> 8;
        let u = f64::from(u) / f64::from(1u32 << 24);
        match i % 7 {
            0 => 0.0,
            1 => u * 40.0,
            2 => (0.98 + 0.04 * u) * full_well_e,
            3 if (i / SIZE.0).is_multiple_of(40) => u * 30.0 * full_well_e,
            _ => 1e-3 * (3e3 * full_well_e).powf(u),
        }
    };
    (0..PIXELS).map(|i| mean(i) as f32).collect()
}

struct Both {
    engine: Engine,
    sensor: Parameters,
    plan: Plan,
    gain_db: f64,
    key: (u64, u64),
}

impl Both {
    fn new(sensor: Parameters, terms: &[Term]) -> Self {
        Self {
            engine: Engine::for_tests(),
            sensor,
            plan: plan(terms),
            gain_db: 0.0,
            key: (1, 2),
        }
    }

    /// Returns the digital numbers of a frame from the CPU and the GPU, or their expected values.
    fn frames(&mut self, expected: bool) -> [Vec<f32>; 2] {
        let fixed = FixedPattern::new(&self.sensor, PIXELS);
        let fixed = self.plan.has(Term::FixedPattern).then_some(&fixed);
        let exposure = (self.gain_db, 0.02);
        let sensor = Sensor::new(&self.sensor, &self.plan, exposure, self.key, fixed);
        let electrons = electrons(self.sensor.full_well_e);
        let percent = self.sensor.blooming_percent;
        let pass = SensorPass::new(&mut self.engine, &self.plan, SIZE, percent, fixed);
        self.engine
            .write("electrons", bytemuck::cast_slice(&electrons));
        let mut commands = self.engine.commands();
        let gpu = if expected {
            pass.expect(&mut self.engine, &mut commands, &sensor)
                .unwrap();
            self.engine.submit(commands);
            let bytes = self.engine.read_back("expected_dn", 0..PIXELS as u64 * 4);
            bytemuck::pod_collect_to_vec(&bytes.unwrap())
        } else {
            pass.read(&mut self.engine, &mut commands, &sensor).unwrap();
            self.engine.submit(commands);
            let bytes = pass.frame_bytes(&sensor);
            let whole = bytes.next_multiple_of(4) as u64;
            let mut frame = self.engine.read_back("frame", 0..whole).unwrap();
            frame.truncate(bytes);
            self.numbers(&frame)
        };
        [self.on_the_cpu(&sensor, electrons, expected), gpu]
    }

    fn on_the_cpu(&self, sensor: &Sensor<'_>, mut means: Vec<f32>, expected: bool) -> Vec<f32> {
        sensor.gather(0, &mut means);
        if self.plan.has(Term::Blooming) {
            let share = (self.sensor.blooming_percent / 100.0) as f32;
            bloom::spill(&mut means, SIZE.0, sensor.full_well_e(), share);
        }
        if expected {
            let mut out = vec![0.0; PIXELS];
            sensor.expect(0, &mut means, &mut out);
            return out;
        }
        let bytes = self.sensor.native_format().bytes_per_pixel();
        let mut frame = vec![0; PIXELS * bytes];
        sensor.read(0, &mut means, &mut frame);
        self.numbers(&frame)
    }

    fn numbers(&self, frame: &[u8]) -> Vec<f32> {
        match self.sensor.native_format().bytes_per_pixel() {
            1 => frame.iter().map(|&b| f32::from(b)).collect(),
            _ => {
                let (pairs, _) = frame.as_chunks();
                let word = |&pair| f32::from(u16::from_le_bytes(pair));
                pairs.iter().map(word).collect()
            }
        }
    }

    /// Returns the number of pixels that differ between CPU and GPU, and the largest difference in
    /// grey levels.
    fn differences(&mut self) -> (usize, f32) {
        let [cpu, gpu] = self.frames(false);
        let differences = cpu.iter().zip(&gpu).map(|(a, b)| (a - b).abs());
        let differ = differences.clone().filter(|d| *d > 0.0).count();
        (differ, differences.fold(0.0, f32::max))
    }
}

/// Maximum number of pixels that may differ. A rounding difference of one bit changes a value at a
/// rounding boundary, and likewise a Poisson draw; the fraction of such pixels grows with the
/// converter's resolution.
fn most_that_differ(bits: u32) -> usize {
    match bits {
        8 => PIXELS / 20_000,
        10 => PIXELS / 10_000,
        12 => PIXELS / 4_000,
        _ => PIXELS / 200,
    }
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_frames_of_every_bit_depth_match_the_cpu() {
    for bits in [8, 10, 12, 16] {
        let linear = Parameters {
            response: CameraResponse::Linear {},
            ..sensor(bits)
        };
        for terms in [&TERMS[..], &TERMS[..4], &[Term::Noise], &[]] {
            for (gain_db, key) in [(0.0, (1, 2)), (12.0, (u64::MAX, 1 << 40))] {
                let all = terms.len() == TERMS.len();
                let parameters = if all { sensor(bits) } else { linear.clone() };
                let mut both = Both::new(parameters, terms);
                (both.gain_db, both.key) = (gain_db, key);
                let (differ, most) = both.differences();
                println!("{bits} bits, {gain_db} dB, {terms:?}: {differ} of {PIXELS}, {most}");
                assert!(differ <= most_that_differ(bits), "{differ}");
                assert!(most <= if bits == 16 { 2.0 } else { 1.0 }, "{most}");
            }
        }
    }
}

/// GPU and CPU agree with each term alone, and with all terms except that one.
#[test]
#[ignore = "needs a Vulkan adapter"]
fn every_gpu_sensor_term_matches_the_cpu() {
    for term in TERMS {
        let rest = TERMS.into_iter().filter(|t| *t != term).collect::<Vec<_>>();
        for terms in [&[term][..], &rest] {
            let (differ, most) = Both::new(sensor(12), terms).differences();
            println!("{terms:?}: {differ} of {PIXELS}, {most}");
            assert!(differ <= most_that_differ(12) && most <= 1.0, "{terms:?}");
        }
    }
}

#[test]
#[ignore = "needs a Vulkan adapter"]
fn gpu_expected_numbers_match_the_cpu() {
    for terms in [&TERMS[..], &TERMS[..2], &[]] {
        let mut both = Both::new(sensor(12), terms);
        let [cpu, gpu] = both.frames(true);
        let worst = cpu.iter().zip(&gpu).map(|(a, b)| (a - b).abs());
        let worst = worst.fold(0.0, f32::max);
        println!("{terms:?}: {worst:e}");
        // Tolerance for values up to 4095, whose f32 rounding error is 2.4e-4.
        assert!(worst < 3e-3, "{terms:?}: {worst}");
    }
}

/// Another noise id gives another image. This guards against a test that compares a frame with
/// itself.
#[test]
#[ignore = "needs a Vulkan adapter"]
fn noise_follows_its_key() {
    let mut both = Both::new(sensor(8), &[Term::Noise]);
    let [_, before] = both.frames(false);
    both.key.1 += 1;
    let [_, after] = both.frames(false);
    let differ = before.iter().zip(&after).filter(|(a, b)| a != b).count();
    assert!(differ > PIXELS / 10, "{differ}");
}
