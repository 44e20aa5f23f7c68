//! Trials of phase noise: one fringe is scanned with one sensor and decoded, and its errors are
//! compared with the bounds.

use super::bound::{floor, least_squares, rounded, swing};
use super::stack::{Fringe, PERIOD_PX};
use phasmid_core::error::Result;
use phasmid_decode::{Decoded, Options};
use phasmid_profile::{Profile, Sensor};
use phasmid_report::lab::{Context, Row};
use std::f64::consts::TAU;

/// Maximum error of an inlier, a quarter of a period: larger errors are wrong periods, not phase noise.
const GROSS_PX: f64 = 0.25 * PERIOD_PX;

/// Errors of the valid pixels of a scan.
pub(super) struct Errors {
    /// Valid pixels.
    pub(super) valid: usize,
    /// Number of valid pixels with a gross error.
    pub(super) gross: usize,
    /// Root mean square error of the inliers, in projector pixels.
    pub(super) rms_px: f64,
    /// Root mean square of the inliers' errors over the least-squares bound at each pixel's mean.
    pub(super) ratio: f64,
    /// Root mean square of the inliers' errors over the decoder's own standard deviations.
    pub(super) whitened: f64,
}

impl Errors {
    fn of(fringe: &Fringe, decoded: &Decoded) -> Self {
        let noise = fringe.noise();
        let (mut valid, mut gross) = (0, 0);
        let (mut squares, mut ratios, mut whitened) = (0.0, 0.0, 0.0);
        let map = decoded.x.as_ref().map_or((&[][..], &[][..]), |map| {
            (&map.coordinate[..], &map.sigma[..])
        });
        for (i, (&x, &sigma)) in map.0.iter().zip(map.1).enumerate() {
            if x.is_nan() {
                continue;
            }
            valid += 1;
            let error = f64::from(x) - fringe.position_px(i);
            if error.abs() > GROSS_PX {
                gross += 1;
                continue;
            }
            let deviation = noise.variance_dn2(fringe.mean_dn_at(i)).sqrt();
            let bound = least_squares(fringe.steps, fringe.modulation_dn, deviation);
            squares += error * error;
            ratios += (error / (bound * PERIOD_PX / TAU)).powi(2);
            whitened += (error / f64::from(sigma)).powi(2);
        }
        let inliers = (valid - gross) as f64;
        Self {
            valid,
            gross,
            rms_px: (squares / inliers).sqrt(),
            ratio: (ratios / inliers).sqrt(),
            whitened: (whitened / inliers).sqrt(),
        }
    }
}

/// Returns an 8-bit sensor whose samples all have the same noise: with many electrons per level, shot
/// noise is at most a hundredth of a level.
pub(super) fn even_sensor(like: &Sensor, noise_dn: f64) -> Sensor {
    let gain = 1e-6;
    Sensor {
        full_well_e: 1e9,
        read_noise_e: noise_dn / gain,
        gain_dn_per_e: gain,
        bits: 8,
        ..like.clone()
    }
}

/// Scans, decodes, and adds errors and bounds to a row.
///
/// # Errors
/// Returns no error for a [`Fringe`].
pub(super) fn measure(fringe: &Fringe, seed: u64, row: Row) -> Result<Row> {
    let stack = fringe.scan(seed);
    let weighing = Options {
        weighted: true,
        ..Options::default()
    };
    let decode = |options| stack.decoder(options)?.decode(stack.images());
    let plain = Errors::of(fringe, &decode(Options::default())?);
    let weighted = Errors::of(fringe, &decode(weighing)?);
    let noise = fringe.noise();
    let variance = noise.variance_dn2(fringe.mean_dn);
    let unrounded = (variance - 1.0 / 12.0).sqrt();
    let m = swing(&noise, fringe.mean_dn, fringe.modulation_dn);
    let (steps, b) = (fringe.steps, fringe.modulation_dn);
    let bound_px = least_squares(steps, b, variance.sqrt()) * PERIOD_PX / TAU;
    Ok(row
        .number("steps", steps as f64)
        .number("modulation_dn", b)
        .number("mean_dn", fringe.mean_dn)
        .number("noise_dn", unrounded)
        .number("swing", m)
        .number("samples", fringe.pixels() as f64)
        .number("bound_px", bound_px)
        .number("rounded", rounded(steps, b, unrounded))
        .number("floor", floor(steps, m))
        .number("valid", plain.valid as f64)
        .number("gross", plain.gross as f64)
        .number("rms_px", plain.rms_px)
        .number("ratio", plain.ratio)
        .number("whitened", plain.whitened)
        .number("weighted_valid", weighted.valid as f64)
        .number("weighted_gross", weighted.gross as f64)
        .number("weighted_ratio", weighted.ratio)
        .number("weighted_whitened", weighted.whitened))
}

/// Times the decoding of a whole frame of `pmp-bench`, with and without weights in turn; returns
/// medians.
///
/// # Errors
/// Returns an error if a built-in profile cannot be read.
pub(super) fn time(context: &Context<'_>) -> Result<Vec<Row>> {
    let fringe = Fringe {
        steps: 12,
        modulation_dn: 80.0,
        mean_dn: 90.0,
        sensor: Profile::load("pmp-bench")?.camera.sensor,
        rows: if context.settings.quick { 512 } else { 2174 },
    };
    let stack = fringe.scan(context.seed);
    let frames = stack.images();
    let mut seconds = [Vec::new(), Vec::new()];
    let mut maps = Decoded::default();
    for _ in 0..if context.settings.quick { 5 } else { 31 } {
        for (weighted, seconds) in [false, true].into_iter().zip(&mut seconds) {
            let options = Options {
                weighted,
                ..Options::default()
            };
            let decoder = stack.decoder(options)?;
            let (decoded, time) = context.timed(|| decoder.decode_into(frames, &mut maps));
            decoded?;
            seconds.push(time);
        }
    }
    let [plain, weighted] = seconds.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    });
    let row = Row::new()
        .text("kind", "time")
        .number("steps", 12.0)
        .number("samples", fringe.pixels() as f64)
        .number("plain_s", plain)
        .number("weighted_s", weighted);
    Ok(vec![row])
}
