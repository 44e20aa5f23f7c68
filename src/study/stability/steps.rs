//! Phase steps: their number, their spacing and their period.

use super::case::{Case, Group, Sweep};
use super::rays::EPS_F32;
use super::stack::{
    EXTENT, Stack, Tally, bound, equal, f32_floor, fringes, gray, manifest, references,
    rounding_gain, sweep,
};
use glam::{DMat3, DVec3};
use phasmid_core::error::Result;
use phasmid_decode::Options;
use phasmid_pattern::Manifest;
use phasmid_report::lab::Context;
use std::f64::consts::TAU;

/// Fraction of a period above which an error is a wrong period, not noise.
pub(super) const GROSS: f64 = 0.25;
const COUNTS: [usize; 12] = [3, 4, 5, 6, 7, 8, 12, 16, 24, 32, 48, 64];

pub(super) const GROUP: Group = Group {
    title: "Fringes",
    sweeps: &[
        Sweep {
            key: "steps",
            title: "3 to 64 steps with noise of 1.5 DN, modulation 90 DN, period 16 px",
            oracle: "Frames from the patterns' formula. Allowed: 1.05 times the least-squares bound \
                sqrt(2/N) sigma / B",
            ratio: "steps",
            error: "RMS error in projector px",
            rounding: false,
            cases: noisy_steps,
        },
        Sweep {
            key: "steps-rounding",
            title: "3 to 64 steps without noise, rounded to 8 bits",
            oracle: "Allowed at the worst pixel: half a grey level in each frame with the worst \
                sign, plus f32 rounding",
            ratio: "steps",
            error: "worst error in projector px",
            rounding: false,
            cases: rounded_steps,
        },
        Sweep {
            key: "steps-bunched",
            title: "Six steps closer and closer together, modulation 20000 DN of 16 bits",
            oracle: "Allowed: 1.05 times the least-squares bound from the inverse of the normal \
                matrix in f64, plus f32 rounding of the weights and the sums. Ratio: condition \
                number of the matrix of steps",
            ratio: "condition",
            error: "RMS error in projector px",
            rounding: false,
            cases: bunched,
        },
        Sweep {
            key: "periods",
            title: "From near-Nyquist fringes to a single fringe over the projector, 8 steps",
            oracle: "Contrast falls by sin(pi w/p)/(pi w/p) with the footprint w of 0.5 px. \
                Allowed: 1.05 times the least-squares bound; pixels on an edge of the code's cells \
                of half a period, a share of 2 w/p, may be left out",
            ratio: "period in px",
            error: "RMS error in projector px",
            rounding: false,
            cases: periods,
        },
    ],
};

/// Creates a case of many pixels. It passes if the errors are within the allowed error, no period is
/// wrong, and at least the fraction `least` of the pixels has a coordinate.
pub(super) fn judged(
    name: impl Into<String>,
    ratio: f64,
    tally: &Tally,
    (found, allowed): (f64, f64),
    least: f64,
) -> Case {
    let name = name.into();
    if tally.gross > 0.0 {
        let says = format!("{:.3} % of wrong periods", 100.0 * tally.gross);
        return Case::failed(name, ratio, &says).kept(tally.kept, least);
    }
    if tally.kept == 0.0 {
        let silent = tally.masked.is_empty();
        let words = if silent {
            "a verdict"
        } else {
            tally.masked.as_str()
        };
        return Case::refused(name, ratio, &tally.masked, words).kept(0.0, least);
    }
    Case::held(name, ratio, found, allowed)
        .kept(tally.kept, least)
        .says(tally.masked.clone())
}

fn noisy_steps(context: &Context<'_>) -> Result<Vec<Case>> {
    let positions = sweep(context);
    let one = |(stream, n): (usize, usize)| {
        let stack = Stack::usual(context, stream);
        let patterns = [equal(16.0, n), gray(8.0, true)].concat();
        let tally = stack.decode(patterns, &positions, stack.options(), GROSS * 16.0)?;
        let allowed = 1.05 * bound(16.0, n, stack.deviation(), 90.0);
        Ok(judged(
            format!("N = {n}"),
            n as f64,
            &tally,
            (tally.rms, allowed),
            0.99,
        ))
    };
    COUNTS.into_iter().enumerate().map(one).collect()
}

fn rounded_steps(context: &Context<'_>) -> Result<Vec<Case>> {
    let positions = sweep(context);
    let one = |n: usize| {
        let stack = Stack {
            noise: 0.0,
            ..Stack::usual(context, 0)
        };
        let patterns = [equal(16.0, n), gray(8.0, true)].concat();
        let tally = stack.decode(patterns, &positions, stack.options(), GROSS * 16.0)?;
        let allowed = 16.0 / TAU * rounding_gain(n) / 90.0 + f32_floor(16.0, n, 110.0, 90.0);
        Ok(judged(
            format!("N = {n}"),
            n as f64,
            &tally,
            (tally.worst, allowed),
            0.99,
        ))
    };
    COUNTS.into_iter().map(one).collect()
}

/// Returns the covariance of (A, C, S) per unit variance of a sample, and the condition number of the
/// matrix of steps.
fn normal(phases: &[f64]) -> (DMat3, f64) {
    let rows = phases.iter().map(|t| DVec3::new(1.0, t.cos(), -t.sin()));
    let normal = rows.fold(DMat3::ZERO, |sum, r| {
        sum + DMat3::from_cols(r * r.x, r * r.y, r * r.z)
    });
    let inverse = normal.inverse();
    let norm = |m: DMat3| m.to_cols_array().iter().map(|v| v * v).sum::<f64>().sqrt();
    (inverse, (norm(normal) * norm(inverse)).sqrt())
}

fn bunched(context: &Context<'_>) -> Result<Vec<Case>> {
    let positions = sweep(context);
    let one = |(stream, apart_deg): (usize, f64)| {
        let stack = Stack {
            floor: 2000.0,
            swing: 40_000.0,
            full: 65535.0,
            ..Stack::usual(context, 20 + stream)
        };
        let phases: Vec<f64> = (0..6)
            .map(|i| (f64::from(i) * apart_deg).to_radians())
            .collect();
        let (inverse, condition) = normal(&phases);
        let name = format!("{apart_deg} degrees apart");
        let patterns = [fringes(16.0, &phases), gray(8.0, true)].concat();
        let tally = match stack.decode(patterns, &positions, stack.options(), GROSS * 16.0) {
            Ok(tally) => tally,
            Err(e) => {
                return Ok(Case::refused(
                    name,
                    condition,
                    &e.to_string(),
                    "different phases",
                ));
            }
        };
        // Average over all phases of c^2 gss - 2 c s gcs + s^2 gcc.
        let mean = 0.5 * (inverse.y_axis.y + inverse.z_axis.z);
        let noise = 16.0 / TAU * mean.sqrt() * stack.deviation() / 20_000.0;
        // Each of six products and six sums rounds a weighted sample.
        let rounding = 2.0 * 6.0 * EPS_F32 * 42_000.0 / 20_000.0;
        let coarse = f32_floor(16.0, 6, 22_000.0, 20_000.0) + 16.0 / TAU * mean.sqrt() * rounding;
        let allowed = 1.05 * noise.hypot(coarse);
        // The decoder rejects pixels whose phase is less precise than 0.15 rad. If the phases are
        // clearly more precise, at least 90 % of the pixels must remain.
        let least = if mean.sqrt() * stack.deviation() / 20_000.0 < 0.05 {
            0.9
        } else {
            0.0
        };
        Ok(judged(name, condition, &tally, (tally.rms, allowed), least))
    };
    [60.0, 30.0, 10.0, 3.0, 2.0, 1.0, 0.5, 0.2, 0.0]
        .into_iter()
        .enumerate()
        .map(one)
        .collect()
}

fn periods(context: &Context<'_>) -> Result<Vec<Case>> {
    let positions = sweep(context);
    let one = |(stream, period): (usize, f64)| {
        let footprint = 0.5;
        let angle = TAU / 2.0 * footprint / period;
        let contrast = angle.sin() / angle;
        let usual = Stack::usual(context, 40 + stream);
        let stack = Stack {
            footprint,
            floor: usual.floor + 90.0 * (1.0 - contrast),
            swing: usual.swing * contrast,
            ..usual
        };
        let mut patterns = equal(period, 8);
        if period < EXTENT {
            patterns.extend(gray(period / 2.0, true));
        } else {
            patterns.extend(references());
        }
        let options = Options {
            keep_mixed: true,
            ..stack.options()
        };
        let tally = stack.decode(patterns, &positions, options, GROSS * period)?;
        let allowed = 1.05 * bound(period, 8, stack.deviation(), 90.0 * contrast);
        let least = 0.99 - 2.0 * footprint / period;
        Ok(judged(
            format!("{period} px"),
            period,
            &tally,
            (tally.rms, allowed),
            least,
        ))
    };
    let mut cases: Vec<Case> = [
        2.1, 2.5, 3.0, 4.0, 8.0, 16.0, 64.0, 256.0, 1024.0, 2000.0, 8000.0,
    ]
    .into_iter()
    .enumerate()
    .map(one)
    .collect::<Result<_>>()?;
    for period in [2.0, 1e7] {
        let text = manifest(equal(period, 8)).to_toml();
        let says = Manifest::parse(&text, "sequence.toml")
            .map_or_else(|e| e.to_string(), |_| String::new());
        cases.push(Case::refused(
            format!("{period} px"),
            period,
            &says,
            "above 2, up to 1e6",
        ));
    }
    Ok(cases)
}
