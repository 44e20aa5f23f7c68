//! Grey levels: low contrast, few levels, saturation, and no light.

use super::case::{Case, Group, Sweep};
use super::stack::{Stack, bound, equal, f32_floor, gray, references, rounding_gain, sweep};
use super::steps::{GROSS, judged};
use phasmid_core::error::Result;
use phasmid_report::lab::Context;
use std::f64::consts::TAU;

const STEPS: usize = 12;
const PERIOD: f64 = 16.0;

pub(super) const GROUP: Group = Group {
    title: "Grey levels",
    sweeps: &[
        Sweep {
            key: "modulation",
            title: "Modulation down to the noise of 1.5 DN, 12 steps",
            oracle: "Allowed for the pixels with an answer: 1.05 times the least-squares bound; if \
                they are fewer than a thousand, plus four standard deviations of their RMS",
            ratio: "modulation over noise",
            error: "RMS error in projector px",
            rounding: false,
            cases: modulation,
        },
        Sweep {
            key: "bits",
            title: "Converters of 1 to 16 bits, values not scaled, lit up to the second-largest \
                value",
            oracle: "Without noise. Allowed at the worst pixel: half a grey level in each frame \
                with the worst sign, plus f32 rounding. Below a modulation of 2 DN there is no \
                answer",
            ratio: "levels",
            error: "worst error in projector px",
            rounding: false,
            cases: |context| bits(context, false),
        },
        Sweep {
            key: "bits-stretched",
            title: "Converters of 1 to 16 bits, values scaled to 8 or 16 bits",
            oracle: "Allowed as for values that are not scaled, with the remaining grey levels",
            ratio: "levels",
            error: "worst error in projector px",
            rounding: false,
            cases: |context| bits(context, true),
        },
        Sweep {
            key: "ambient",
            title: "Fringes of 60 DN on increasing constant light, 16 bits without noise",
            oracle: "Allowed at the worst pixel: half a grey level in each frame, plus f32 \
                rounding of sums as large as the light",
            ratio: "mean over modulation",
            error: "worst error in projector px",
            rounding: false,
            cases: ambient,
        },
        Sweep {
            key: "saturation",
            title: "Light up to eight times the converter's full scale, noise 1.5 DN",
            oracle: "A sample at full scale invalidates its pixel. Allowed for the pixels with an \
                answer: 1.05 times the least-squares bound; if they are fewer than a thousand, \
                plus four standard deviations of their RMS",
            ratio: "brightest over full scale",
            error: "RMS error in projector px",
            rounding: false,
            cases: saturation,
        },
        Sweep {
            key: "black",
            title: "No light or hardly any, noise 1.5 DN",
            oracle: "Below a modulation of 2 DN no fringe is accepted. Allowed for the pixels with \
                an answer: 1.05 times the least-squares bound",
            ratio: "modulation over noise",
            error: "RMS error in projector px",
            rounding: false,
            cases: black,
        },
    ],
};

fn modulation(context: &Context<'_>) -> Result<Vec<Case>> {
    let one = |(stream, modulation): (usize, f64)| {
        let stack = Stack {
            floor: 60.0,
            swing: 2.0 * modulation,
            ..Stack::usual(context, 60 + stream)
        };
        faint(context, &stack, if modulation >= 10.0 { 0.95 } else { 0.0 })
    };
    [90.0, 30.0, 15.0, 10.0, 7.0, 5.0, 4.0, 3.0, 2.0, 1.5]
        .into_iter()
        .enumerate()
        .map(one)
        .collect()
}

fn black(context: &Context<'_>) -> Result<Vec<Case>> {
    let one = |(stream, modulation): (usize, f64)| {
        let stack = Stack {
            floor: 4.0,
            swing: 2.0 * modulation,
            ..Stack::usual(context, 80 + stream)
        };
        faint(context, &stack, 0.0)
    };
    [0.0, 0.1, 0.5, 1.0]
        .into_iter()
        .enumerate()
        .map(one)
        .collect()
}

/// Decodes a fringe with a given ratio of modulation to noise.
fn faint(context: &Context<'_>, stack: &Stack, least: f64) -> Result<Case> {
    let modulation = 0.5 * stack.swing;
    let patterns = [equal(PERIOD, STEPS), gray(8.0, true)].concat();
    let positions = sweep(context);
    let tally = stack.decode(patterns, &positions, stack.options(), GROSS * PERIOD)?;
    let bound = bound(PERIOD, STEPS, stack.deviation(), modulation);
    let allowed = 1.05 * bound * scatter(tally.kept * positions.len() as f64);
    let name = format!("{modulation} DN");
    let ratio = modulation / stack.deviation();
    Ok(judged(name, ratio, &tally, (tally.rms, allowed), least))
}

/// Returns the factor by which the RMS of few values may exceed its expectation. The RMS of n values has
/// a relative sigma of 1 / sqrt(2 n).
fn scatter(answered: f64) -> f64 {
    match answered < 1000.0 {
        true => 1.0 + 4.0 / (2.0 * answered).sqrt(),
        false => 1.0,
    }
}

fn bits(context: &Context<'_>, stretched: bool) -> Result<Vec<Case>> {
    let positions = sweep(context);
    let one = |bits: u32| {
        let levels = f64::from((1u32 << bits) - 1);
        let full = if !stretched {
            levels
        } else if bits <= 8 {
            255.0
        } else {
            65535.0
        };
        let stack = Stack {
            floor: 0.0,
            // The brightest level rounds to the second-largest value.
            swing: full - 0.51 * full / levels,
            noise: 0.0,
            full,
            grain: full / levels,
            ..Stack::usual(context, 0)
        };
        let patterns = [equal(PERIOD, STEPS), gray(8.0, true)].concat();
        let tally = stack.decode(patterns, &positions, stack.options(), GROSS * PERIOD)?;
        let modulation = 0.5 * stack.swing;
        // A stretched level is truncated to an integer.
        let step = stack.grain + if stretched { 1.0 } else { 0.0 };
        let allowed = PERIOD / TAU * rounding_gain(STEPS) * step / modulation
            + f32_floor(PERIOD, STEPS, modulation, modulation);
        let least = if modulation >= 2.0 && bits >= 4 {
            0.95
        } else {
            0.0
        };
        let name = format!("{bits} bits");
        Ok(judged(
            name,
            levels + 1.0,
            &tally,
            (tally.worst, allowed),
            least,
        ))
    };
    (1..=16).map(one).collect()
}

fn ambient(context: &Context<'_>) -> Result<Vec<Case>> {
    let positions = sweep(context);
    let one = |mean: f64| {
        let stack = Stack {
            floor: mean - 60.0,
            swing: 120.0,
            noise: 0.0,
            full: 65535.0,
            ..Stack::usual(context, 0)
        };
        let patterns = [equal(PERIOD, STEPS), gray(8.0, true), references()].concat();
        let tally = stack.decode(patterns, &positions, stack.options(), GROSS * PERIOD)?;
        let allowed =
            PERIOD / TAU * rounding_gain(STEPS) / 60.0 + f32_floor(PERIOD, STEPS, mean, 60.0);
        let name = format!("{mean} DN");
        Ok(judged(
            name,
            mean / 60.0,
            &tally,
            (tally.worst, allowed),
            0.95,
        ))
    };
    [60.0, 600.0, 6000.0, 30_000.0, 65_000.0]
        .into_iter()
        .map(one)
        .collect()
}

fn saturation(context: &Context<'_>) -> Result<Vec<Case>> {
    let positions = sweep(context);
    let one = |(stream, over): (usize, f64)| {
        let stack = Stack {
            floor: 0.1 * over * 255.0,
            swing: 0.9 * over * 255.0,
            ..Stack::usual(context, 90 + stream)
        };
        // With four steps, some phases have no sample at full scale.
        let patterns = [equal(PERIOD, 4), gray(8.0, true)].concat();
        let tally = stack.decode(patterns, &positions, stack.options(), GROSS * PERIOD)?;
        let bound = bound(PERIOD, 4, stack.deviation(), 0.5 * stack.swing);
        let allowed = 1.05 * bound * scatter(tally.kept * positions.len() as f64);
        let least = if over < 0.99 { 0.99 } else { 0.0 };
        let name = format!("{over} of full scale");
        Ok(judged(name, over, &tally, (tally.rms, allowed), least))
    };
    [0.9, 0.97, 1.0, 1.03, 1.1, 1.15, 1.2, 1.5, 2.0, 4.0, 8.0]
        .into_iter()
        .enumerate()
        .map(one)
        .collect()
}
