//! A billion frames: counters, noise keys and device time.

use super::case::{Case, Group, Sweep};
use super::exposures::{SURE, fine, white, white_plane};
use super::rays::EPS_F32;
use super::scenes::small;
use crate::scanned::levels;
use phasmid_core::error::Result;
use phasmid_render::Renderer;
use phasmid_render::shot::Shot;
use phasmid_report::lab::Context;

/// Frame ids: the first, after a billion, around the limits of 32 and 53 bits, and the last.
const IDS: [u64; 7] = [
    0,
    1_000_000,
    1_000_000_000,
    (1 << 32) - 1,
    1 << 32,
    (1 << 53) + 1,
    u64::MAX - 1,
];
const PERIOD_NS: u64 = 20_000_000;

pub(super) const GROUP: Group = Group {
    title: "A billion frames",
    sweeps: &[
        Sweep {
            key: "frames-statistics",
            title: "Noise of 8 consecutive frames that start at each of these frame numbers",
            oracle: "Variance by EMVA 1288, as for the first frames. Allowed: 4 standard \
                deviations",
            ratio: "frame",
            error: "relative error of the variance",
            rounding: false,
            cases: statistics,
        },
        Sweep {
            key: "frames-repetition",
            title: "Noise of each of these frames, compared with the first frame, the next frame \
                and the same frame again",
            oracle: "The correlation of independent frames is 0 within 4 / sqrt(pixels), or 5 / \
                sqrt(pixels) for the largest of many; the same frame again has the same bytes",
            ratio: "frame",
            error: "largest correlation",
            rounding: false,
            cases: repetition,
        },
        Sweep {
            key: "frames-time",
            title: "Device time of a frame every 20 ms",
            oracle: "Integer nanoseconds: start and end of an exposure are exact",
            ratio: "frame",
            error: "error in ns",
            rounding: false,
            cases: |_| time(),
        },
        Sweep {
            key: "frames-flicker",
            title: "Lamps at 120 Hz, whose period is not a whole number of nanoseconds",
            oracle: "After whole seconds the light is the same. In f64 seconds the phase would be \
                off by some 1e-6 rad after a billion frames; whole periods are therefore \
                subtracted in integers. Allowed: roundings of f32",
            ratio: "frame",
            error: "worst error in DN",
            rounding: false,
            cases: |_| flicker(),
        },
    ],
};

/// A frame's noise in units of its standard deviation, and its bytes.
struct Noise {
    values: Vec<f64>,
    data: Vec<u8>,
}

struct Bench {
    renderer: Renderer,
    mean: Vec<f32>,
    variance: f64,
}

impl Bench {
    fn new(seed: u64) -> Result<Self> {
        let profile = fine()?;
        let mut quiet = profile.clone();
        quiet.camera.sensor.noiseless = true;
        let scene = white_plane("")?;
        let mean = Renderer::new(&quiet, &scene, 1)?.expected_dn(&white(100_000, 0));
        let sensor = &profile.camera.sensor;
        let gain = sensor.gain_dn_per_e;
        let signal = mean.iter().map(|dn| f64::from(*dn)).sum::<f64>() / mean.len() as f64;
        let electrons = (signal - sensor.black_level_dn) / gain;
        Ok(Self {
            renderer: Renderer::new(&profile, &scene, seed)?,
            mean,
            variance: gain.powi(2) * (sensor.read_noise_e.powi(2) + electrons) + 1.0 / 12.0,
        })
    }

    fn noise(&mut self, id: u64) -> Result<Noise> {
        let frame = self.renderer.expose(&white(100_000, id));
        let data = frame.data.clone();
        let values = levels(frame)?;
        let sigma = self.variance.sqrt();
        let values = values.iter().zip(&self.mean);
        let values = values
            .map(|(dn, mean)| (dn - f64::from(*mean)) / sigma)
            .collect();
        Ok(Noise { values, data })
    }
}

fn statistics(context: &Context<'_>) -> Result<Vec<Case>> {
    let mut bench = Bench::new(context.seed)?;
    let one = |id: u64| {
        let (mut sum, mut count) = (0.0, 0.0);
        for k in 0..8 {
            let noise = bench.noise(id.saturating_sub(7).saturating_add(k))?;
            sum += noise.values.iter().map(|v| v * v).sum::<f64>();
            count += noise.values.len() as f64;
        }
        let allowed = SURE * (2.1 / count).sqrt();
        Ok(Case::held(
            format!("frame {id}"),
            id as f64,
            (sum / count - 1.0).abs(),
            allowed,
        ))
    };
    IDS.into_iter().map(one).collect()
}

fn repetition(context: &Context<'_>) -> Result<Vec<Case>> {
    let mut bench = Bench::new(context.seed)?;
    let first: Vec<Noise> = (0..4).map(|id| bench.noise(id)).collect::<Result<_>>()?;
    let correlation = |a: &Noise, b: &Noise| {
        let sum: f64 = a.values.iter().zip(&b.values).map(|(a, b)| a * b).sum();
        (sum / a.values.len() as f64).abs()
    };
    let mut cases = Vec::new();
    for id in IDS.into_iter().skip(1) {
        let (own, again) = (bench.noise(id)?, bench.noise(id)?);
        let next = bench.noise(id - 1)?;
        let name = format!("frame {id}");
        if own.data != again.data {
            cases.push(Case::failed(
                name,
                id as f64,
                "the same frame rendered twice has different bytes",
            ));
            continue;
        }
        let mut found = correlation(&own, &next);
        found = first
            .iter()
            .map(|other| correlation(&own, other))
            .fold(found, f64::max);
        let allowed = 5.0 / (own.values.len() as f64).sqrt();
        cases.push(Case::held(name, id as f64, found, allowed));
    }
    Ok(cases)
}

fn time() -> Result<Vec<Case>> {
    let mut renderer = Renderer::new(&small()?, &white_plane("")?, 1)?;
    let mut one = |id: u64| {
        let start_ns = id * PERIOD_NS + 7;
        let frame = renderer.expose(&Shot {
            start_ns,
            ..white(8_000_001, id)
        });
        let off = frame.exposure_start_ns.abs_diff(start_ns)
            + frame.exposure_end_ns.abs_diff(start_ns + 8_000_001)
            + frame.id.abs_diff(id);
        Case::held(format!("frame {id}"), id as f64, off as f64, 0.0)
    };
    Ok(IDS[..5].iter().map(|&id| one(id)).collect())
}

fn flicker() -> Result<Vec<Case>> {
    let lamp = "ambient = { irradiance_w_m2 = 0.05, flicker = { frequency_hz = 120, depth = 0.9, phase_deg = 30.0 } }\n";
    let mut profile = small()?;
    profile.camera.sensor.noiseless = true;
    let mut renderer = Renderer::new(&profile, &white_plane(lamp)?, 1)?;
    let mut at = |start_ns: u64| {
        renderer.expected_dn(&Shot {
            light: 0.0,
            start_ns,
            ..white(3_000_000, 0)
        })
    };
    let (first, half) = (at(0), at(4_166_667));
    let swing = first
        .iter()
        .zip(&half)
        .map(|(a, b)| f64::from((a - b).abs()))
        .fold(0.0, f64::max);
    let mut cases = Vec::new();
    for frames in [50u64, 1_000_000, 1_000_000_000, 500_000_000_000] {
        let late = at(frames * PERIOD_NS);
        let off = first
            .iter()
            .zip(&late)
            .map(|(a, b)| f64::from((a - b).abs()));
        let found = off.fold(0.0, f64::max);
        let case = Case::held(
            format!("frame {frames}"),
            frames as f64,
            found,
            16.0 * EPS_F32 * 255.0,
        );
        // Require that the lamp flickers; without flicker the case would test nothing.
        cases.push(case.kept(f64::from(u8::from(swing > 1.0)), 1.0));
    }
    Ok(cases)
}
