//! From a trigger's command to the whole frame at the host, over each link. A trigger is `*TRG` in
//! mode `STEP`, which exposes the next pattern; time runs from before the command is written until
//! the camera has given the frame with that pattern.

use super::links::{bytes, in_turns, patterns, profile, row};
use super::talk::{Talk, over};
use crate::timing::{Stopwatch, quantile};
use phasmid_core::error::Result;
use phasmid_profile::Scene;
use phasmid_report::lab::{Context, Row, Settings, Trial};

/// Rounds over the links, and triggers of a link in each.
const ROUNDS: [usize; 2] = [5, 220];
const QUICK_ROUNDS: [usize; 2] = [2, 66];

/// The trial.
pub fn trial(settings: &Settings) -> Trial {
    super::links::trial(settings, "latency", run)
}

fn run(ctx: &Context<'_>, group: &'static str) -> Result<Vec<Row>> {
    let profile = profile(ctx.settings)?;
    let scene = Scene::load("trapezoid")?;
    let [rounds, count] = if ctx.settings.quick {
        QUICK_ROUNDS
    } else {
        ROUNDS
    };
    let counts = (patterns(&profile), count);
    let watch = ctx.stopwatch();
    let found = in_turns(rounds, |link| {
        over(ctx, (&profile, &scene), (link, "STEP"), |talk| {
            triggered(watch, talk, counts)
        })
    });
    let bytes = bytes(&profile);
    let copy_us = watch.seconds_a_copy(bytes) * 1e6;
    let complete = |row: Row, mut seconds: Vec<f64>| {
        seconds.sort_by(f64::total_cmp);
        let us = |share| quantile(&seconds, share) * 1e6;
        row.number("frames", seconds.len() as f64)
            .number("bytes", bytes as f64)
            .number("median_us", us(0.5))
            .number("p99_us", us(0.99))
            .number("least_us", us(0.0))
            .number("most_us", us(1.0))
            .number("copy_us", copy_us)
    };
    let rows = found.into_iter();
    Ok(rows
        .map(|(link, found)| row(group, link, found, complete))
        .collect())
}

/// The seconds of so many triggers, after a first sequence that makes what is made once.
fn triggered(
    watch: Stopwatch<'_>,
    talk: &mut Talk,
    (frames, count): (usize, usize),
) -> Result<Vec<f64>> {
    let mut seconds = Vec::new();
    let mut warm = false;
    while seconds.len() < count {
        talk.instrument.order("INIT")?;
        for index in 0..frames {
            if !warm {
                talk.instrument.tell("*TRG")?;
                talk.first_frame(index)?;
                continue;
            }
            let (frame, took) = watch.timed(|| {
                talk.instrument.tell("*TRG")?;
                talk.frame(index)
            });
            frame?;
            seconds.push(took);
        }
        warm = true;
    }
    seconds.truncate(count);
    Ok(seconds)
}
