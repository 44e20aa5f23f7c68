//! Fringe orders where they change: at phase wraps, at code edges, and with two nearly equal periods.

use super::case::{Case, Group, Sweep};
use super::stack::{
    EXTENT, Stack, Tally, WIDTH, equal, f32_floor, finest_bit, gray, references, rounding_gain,
    sweep,
};
use phasmid_core::error::Result;
use phasmid_decode::Options;
use phasmid_pattern::Pattern;
use phasmid_report::lab::Context;
use std::f64::consts::TAU;

const PERIOD: f64 = 16.0;
const STEPS: usize = 12;
/// Maximum fraction of wrong periods among the answered pixels: decisions have a margin of four
/// standard deviations.
const WRONG: f64 = 1e-4;

pub(super) const GROUP: Group = Group {
    title: "Whole periods",
    sweeps: &[
        Sweep {
            key: "wraps",
            title: "Pixels on the wraps of the phase and on the edges of the code, 16 bits without noise",
            oracle: "Positions on and beside multiples of half a period, where edges of all bits \
                lie. Allowed at the worst pixel: rounding and f32. Ratio: period over distance to \
                the wrap",
            ratio: "period over distance",
            error: "worst error in projector px",
            rounding: false,
            cases: wraps,
        },
        Sweep {
            key: "edges",
            title: "Code edges on the wraps and away from them, with noise, periods of 16 px",
            oracle: "Allowed: a wrong period at one in ten thousand of the pixels with an answer",
            ratio: "modulation over noise",
            error: "share of wrong periods",
            rounding: false,
            cases: edges,
        },
        Sweep {
            key: "beats",
            title: "Two periods without a code, closer and closer to each other: 64 px and \
                slightly more",
            oracle: "The beat is the period times the ratio; beyond the projector's 1920 px it \
                identifies every period, but the noise of the phases grows with it. Allowed: one \
                wrong period in ten thousand",
            ratio: "beat over period",
            error: "share of wrong periods",
            rounding: false,
            cases: beats,
        },
    ],
};

/// Returns the codes that a sequence may have for periods of 16 px.
fn codes() -> [(&'static str, Vec<Pattern>); 4] {
    [
        ("cells of half a period", gray(8.0, false)),
        ("with complements", gray(8.0, true)),
        (
            "complementary bit",
            [gray(16.0, false), finest_bit(8.0)].concat(),
        ),
        ("edges on the wraps", gray(16.0, false)),
    ]
}

/// Creates a case whose error is the fraction of wrong periods. If no pixel has a coordinate, the
/// reasons for its absence are the message.
fn counted(name: String, ratio: f64, tally: &Tally, least: f64) -> Case {
    let case = if tally.kept > 0.0 {
        Case::held(name, ratio, tally.gross, WRONG).says(tally.masked.clone())
    } else {
        Case::refused(name, ratio, &tally.masked, "%")
    };
    case.kept(tally.kept, least)
}

fn wraps(context: &Context<'_>) -> Result<Vec<Case>> {
    let stack = Stack {
        floor: 2000.0,
        swing: 60_000.0,
        noise: 0.0,
        full: 65535.0,
        ..Stack::usual(context, 0)
    };
    let options = Options {
        keep_mixed: true,
        ..stack.options()
    };
    let allowed = PERIOD / TAU * rounding_gain(STEPS) / 30_000.0
        + f32_floor(PERIOD, STEPS, 32_000.0, 30_000.0);
    let mut cases = Vec::new();
    for (code, patterns) in codes() {
        for distance in [1.0, 1e-2, 1e-4, 1e-6, 0.0] {
            let positions: Vec<f64> = (0..WIDTH)
                .flat_map(|u| [-distance, distance].map(|d| (u, d)))
                .map(|(u, d)| ((8.0 + 7.4 * u as f64) / 8.0).round() * 8.0 + d)
                .collect();
            let patterns = [equal(PERIOD, STEPS), patterns.clone(), references()].concat();
            let tally = stack.decode(patterns, &positions, options, 0.25 * PERIOD)?;
            let name = format!("{code}, {distance} px off");
            let case = Case::held(name, PERIOD / distance, tally.worst, allowed);
            cases.push(case.kept(tally.kept, 1.0).says(tally.masked));
        }
    }
    Ok(cases)
}

fn edges(context: &Context<'_>) -> Result<Vec<Case>> {
    let positions = sweep(context);
    let mut cases = Vec::new();
    for (place, (code, patterns)) in codes().into_iter().enumerate() {
        for (k, noise) in [2.0, 4.0, 8.0, 16.0].into_iter().enumerate() {
            let stack = Stack {
                floor: 60.0,
                swing: 80.0,
                noise,
                ..Stack::usual(context, 120 + 8 * place + k)
            };
            let options = Options {
                keep_mixed: true,
                ..stack.options()
            };
            let patterns = [equal(PERIOD, STEPS), patterns.clone(), references()].concat();
            let tally = stack.decode(patterns, &positions, options, 0.25 * PERIOD)?;
            let name = format!("{code}, noise {noise} DN");
            let least = if noise <= 2.0 { 0.9 } else { 0.0 };
            cases.push(counted(name, 40.0 / stack.deviation(), &tally, least));
        }
    }
    Ok(cases)
}

fn beats(context: &Context<'_>) -> Result<Vec<Case>> {
    let positions = sweep(context);
    let one = |(k, ratio): (usize, f64)| {
        let stack = Stack::usual(context, 160 + k);
        let other = 64.0 * ratio / (ratio - 1.0);
        let patterns = [equal(64.0, 8), equal(other, 8)].concat();
        let name = format!("64 px and {other:.3} px");
        let options = Options {
            keep_mixed: true,
            ..stack.options()
        };
        let tally = match stack.decode(patterns, &positions, options, 16.0) {
            Ok(tally) => tally,
            Err(e) => return Ok(Case::refused(name, ratio, &e.to_string(), "repeat after")),
        };
        // If the beat is as long as the projector is wide, there must be answers, unless noise is too
        // large.
        let least = if (32.0..=40.0).contains(&ratio) {
            0.9
        } else {
            0.0
        };
        Ok(counted(name, ratio, &tally, least))
    };
    let whole = EXTENT / 64.0;
    [4.0, 15.0, whole, 32.0, 40.0, 60.0, 120.0, 300.0, 1000.0]
        .into_iter()
        .enumerate()
        .map(one)
        .collect()
}
