//! From a trigger's command to the whole frame at the host, over each link. A trigger is `*TRG` in
//! mode `STEP`, which exposes the next pattern; time runs from before the command is written until
//! the camera has given the frame with that pattern.

use super::links::{Link, Talk, bytes, over, patterns, profile, row};
use crate::error::Result;
use crate::profile::Scene;
use crate::study::lab::{Context, Row, Settings, Trial};
use crate::study::timing::{Stopwatch, quantile};

/// A trial for each link.
pub fn trials(settings: &Settings) -> Vec<Trial> {
    super::links::trials(settings, "latency", run)
}

fn run(ctx: &Context<'_>, group: &'static str, link: Link) -> Result<Vec<Row>> {
    let profile = profile(ctx.settings)?;
    let scene = Scene::load("trapezoid")?;
    let count = if ctx.settings.quick { 44 } else { 1100 };
    let counts = (patterns(&profile), count);
    let watch = ctx.stopwatch();
    let found = over(ctx, (&profile, &scene), (link, "STEP"), |talk| {
        triggered(watch, talk, counts)
    });
    let bytes = bytes(&profile);
    let complete = |mut seconds: Vec<f64>| {
        seconds.sort_by(f64::total_cmp);
        let copy_us = watch.seconds_a_copy(bytes) * 1e6;
        move |row: Row| {
            let us = |share| quantile(&seconds, share) * 1e6;
            row.number("frames", seconds.len() as f64)
                .number("bytes", bytes as f64)
                .number("median_us", us(0.5))
                .number("p99_us", us(0.99))
                .number("least_us", us(0.0))
                .number("most_us", us(1.0))
                .number("copy_us", copy_us)
        }
    };
    Ok(row(group, link, found.map(complete)))
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
