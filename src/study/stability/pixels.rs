//! Size of camera pixels relative to the projector: narrower than a projector pixel, and wider than the
//! finest stripes of the code.

use super::case::{Case, Group, Sweep};
use super::stack::{SWEEP_STEP, Stack, Tally, WIDTH, bound, equal, gray, sweep};
use super::steps::{GROSS, judged};
use phasmid_core::error::Result;
use phasmid_report::lab::Context;
use std::f64::consts::PI;

const STEPS: usize = 12;
const PERIOD: f64 = 16.0;
/// Modulation in DN of 12 bits.
const MODULATION: f64 = 1800.0;
/// Noise of a coordinate in projector pixels.
const NOISE_PX: f64 = 0.01;
/// Period for codes with stripes narrower than a camera pixel.
const LONG: f64 = 32.0;
/// Widths of a camera pixel in projector pixels.
const WIDTHS: [f64; 11] = [0.2, 0.3, 0.4, 0.5, 0.7, 0.9, 1.0, 1.25, 1.5, 2.0, 2.5];

pub(super) const GROUP: Group = Group {
    title: "Pixels against pixels",
    sweeps: &[
        Sweep {
            key: "held",
            title: "Camera pixels of 0.2 to 2.5 projector pixels, sharp, 12 bits with noise of 0.01 px",
            oracle: "Levels of whole projector pixels, averaged over the camera pixel. Narrower \
                camera pixels see a single projector pixel, which does not determine their \
                position in it. Allowed: 1.1 times the square root of (1 - w)^3 / 12 + (1 - w) \
                sigma / 3 (w below 1) and 1.2 sigma^2",
            ratio: "camera pixel in projector px",
            error: "RMS error in projector px",
            rounding: false,
            cases: held,
        },
        Sweep {
            key: "held-stated",
            title: "Camera pixels as in the previous sweep: error against the stated standard deviation",
            oracle: "Allowed: 1.1 times the stated standard deviation",
            ratio: "camera pixel in projector px",
            error: "RMS error in projector px",
            rounding: false,
            cases: stated,
        },
        Sweep {
            key: "unresolved-bits",
            title: "Code stripes from two camera pixels to an eighth of one, period 32 px, noise 1.5 DN",
            oracle: "Allowed: 1.05 times the least-squares bound; no wrong period",
            ratio: "camera pixel over stripe",
            error: "RMS error in projector px",
            rounding: false,
            cases: unresolved,
        },
    ],
};

/// Decodes frames with camera pixels of this width.
fn seen(context: &Context<'_>, stream: usize, width: f64) -> Result<(Stack, Tally)> {
    let stack = Stack {
        floor: 200.0,
        swing: 2.0 * MODULATION,
        // Choose the noise for which the least-squares bound is `NOISE_PX`.
        noise: NOISE_PX / bound(PERIOD, STEPS, 1.0, MODULATION),
        footprint: width,
        held: true,
        full: 4095.0,
        ..Stack::usual(context, 170 + stream)
    };
    let height = if context.settings.quick { 40 } else { 160 };
    let positions: Vec<f64> = (0..WIDTH * height)
        .map(|i| {
            let (u, v) = ((i % WIDTH) as f64, (i / WIDTH) as f64);
            100.0 + width * u + 0.0317 * v
        })
        .collect();
    let patterns = [equal(PERIOD, STEPS), gray(0.5 * PERIOD, true)].concat();
    let tally = stack.decode(patterns, &positions, stack.options(), GROSS * PERIOD)?;
    Ok((stack, tally))
}

fn held(context: &Context<'_>) -> Result<Vec<Case>> {
    let one = |(stream, width): (usize, f64)| {
        let (stack, tally) = seen(context, stream, width)?;
        let contrast = sinc(1.0 / PERIOD) * sinc(width / PERIOD);
        let sigma = bound(PERIOD, STEPS, stack.deviation(), MODULATION * contrast);
        let narrow = (1.0 - width).max(0.0);
        let variance = narrow.powi(3) / 12.0 + narrow * sigma / 3.0 + 1.2 * sigma * sigma;
        let allowed = 1.1 * variance.sqrt();
        let name = format!("{width} px");
        Ok(judged(name, width, &tally, (tally.rms, allowed), 0.95))
    };
    WIDTHS.into_iter().enumerate().map(one).collect()
}

fn stated(context: &Context<'_>) -> Result<Vec<Case>> {
    let one = |(stream, width): (usize, f64)| {
        let (_, tally) = seen(context, stream, width)?;
        let errors = (tally.rms, 1.1 * tally.stated);
        Ok(judged(format!("{width} px"), width, &tally, errors, 0.95))
    };
    WIDTHS.into_iter().enumerate().map(one).collect()
}

/// sin(pi x) / (pi x): the contrast of a fringe averaged over x periods.
fn sinc(x: f64) -> f64 {
    (PI * x).sin() / (PI * x)
}

fn unresolved(context: &Context<'_>) -> Result<Vec<Case>> {
    let positions = sweep(context);
    let one = |(stream, cell): (usize, f64)| {
        let stack = Stack {
            footprint: SWEEP_STEP,
            held: true,
            ..Stack::usual(context, 190 + stream)
        };
        let patterns = [equal(LONG, STEPS), gray(cell, true)].concat();
        let tally = stack.decode(patterns, &positions, stack.options(), GROSS * LONG)?;
        let modulation = 0.5 * stack.swing * sinc(1.0 / LONG) * sinc(SWEEP_STEP / LONG);
        let allowed = 1.05 * bound(LONG, STEPS, stack.deviation(), modulation);
        let (name, ratio) = (format!("stripes of {cell} px"), SWEEP_STEP / cell);
        let case = judged(name, ratio, &tally, (tally.rms, allowed), 0.9);
        let masked = (!tally.masked.is_empty()).then_some(tally.masked);
        let unused = match tally.unused_bits {
            0 => None,
            1 => Some("finest bit left out".to_owned()),
            bits => Some(format!("{bits} finest bits left out")),
        };
        let says: Vec<String> = unused.into_iter().chain(masked).collect();
        Ok(case.says(says.join("; ")))
    };
    [16.0, 8.0, 4.0, 2.0, 1.0]
        .into_iter()
        .enumerate()
        .map(one)
        .collect()
}
