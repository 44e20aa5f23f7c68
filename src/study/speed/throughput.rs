//! Frames a second at the host over each link. `*TRG` in mode `SEQ` exposes a whole sequence; time
//! runs from before the command is written until the sequence's last frame has come. The device has
//! no noise and a plane before it, so that a frame takes little to render; what is left of that is
//! the row of the device in memory.

use super::links::{Link, bytes, in_turns, patterns, profile, row};
use super::talk::{TIMEOUT, Talk, over};
use crate::timing::{Spread, Stopwatch};
use phasmid_core::error::{Error, Result};
use phasmid_profile::Scene;
use phasmid_report::lab::{Context, Row, Settings, Trial};
use std::time::Duration;

/// A camera of which nothing came for so long has no more frames.
const QUIET: Duration = Duration::from_millis(800);

/// Rounds over the links, and sequences over a link in each.
const ROUNDS: [usize; 2] = [5, 20];
const QUICK_ROUNDS: [usize; 2] = [2, 3];

/// The trial.
pub fn trial(settings: &Settings) -> Trial {
    super::links::trial(settings, "throughput", run)
}

fn run(ctx: &Context<'_>, group: &'static str) -> Result<Vec<Row>> {
    let mut profile = profile(ctx.settings)?;
    profile.camera.sensor.noiseless = true;
    let scene = Scene::load("plane")?;
    let [rounds, turns] = if ctx.settings.quick {
        QUICK_ROUNDS
    } else {
        ROUNDS
    };
    let frames = patterns(&profile);
    let watch = ctx.stopwatch();
    let found = in_turns(rounds, |link| {
        over(ctx, (&profile, &scene), (link, "SEQ"), |talk| {
            warm_up(talk, frames)?;
            let runs = (0..turns).map(|_| sequence(watch, talk, frames, link));
            runs.collect::<Result<Vec<_>>>()
        })
    });
    let bytes = bytes(&profile);
    let copy_us = watch.seconds_a_copy(bytes) * 1e6;
    let complete = |row: Row, runs: Vec<(usize, f64)>| {
        let all = runs.len() * frames;
        let came: usize = runs.iter().map(|run| run.0).sum();
        let rates = runs.iter().map(|&(came, seconds)| came as f64 / seconds);
        let rate = Spread::new(rates.collect());
        row.number("frames", all as f64)
            .number("bytes", bytes as f64)
            .number("lost", (all - came) as f64)
            .number("rate", rate.median)
            .number("rate_low", rate.low)
            .number("rate_high", rate.high)
            .number("copy_us", copy_us)
    };
    let rows = found.into_iter();
    Ok(rows
        .map(|(link, found)| row(group, link, found, complete))
        .collect())
}

/// A sequence that makes what is made once; then nothing of it, or of an earlier stream, is left in the
/// camera.
fn warm_up(talk: &mut Talk, frames: usize) -> Result<()> {
    talk.instrument.order("INIT")?;
    talk.instrument.tell("*TRG")?;
    let (mut came, mut over) = (0, false);
    loop {
        let wait = if over { QUIET } else { TIMEOUT };
        match talk.camera.next_frame(wait) {
            Ok(None) if came > 0 => return Ok(()),
            Ok(None) => return Err(Error::device("no frame within 20 s")),
            Ok(Some(frame)) => {
                came += 1;
                // The first one may be the last of an earlier stream.
                let last = frame
                    .pattern_index
                    .is_some_and(|i| i as usize + 1 == frames);
                over |= last && came > 1;
            }
            Err(_) if talk.camera.has_skipped() => {}
            Err(e) => return Err(e),
        }
    }
}

/// How many frames of a sequence came, and the seconds until the last of them had.
fn sequence(
    watch: Stopwatch<'_>,
    talk: &mut Talk,
    frames: usize,
    link: Link,
) -> Result<(usize, f64)> {
    talk.instrument.order("INIT")?;
    let begin = watch.now_s();
    talk.instrument.tell("*TRG")?;
    let (mut came, mut next, mut last_s) = (0, 0, begin);
    while next < frames {
        let may_be_lost = link.overwrites() && came > 0;
        let wait = if may_be_lost { QUIET } else { TIMEOUT };
        let Some(frame) = talk.camera.next_frame(wait)? else {
            break;
        };
        last_s = watch.now_s();
        let index = frame.pattern_index.map_or(usize::MAX, |i| i as usize);
        let in_order = index == next || (link.overwrites() && (next..frames).contains(&index));
        if !in_order {
            return Err(Error::device(format!("frame {next} is another")));
        }
        came += 1;
        next = index + 1;
    }
    if came == 0 || (next < frames && !link.overwrites()) {
        return Err(Error::device(format!("no frame {next} within 20 s")));
    }
    Ok((came, last_s - begin))
}
