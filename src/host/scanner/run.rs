//! One run: the frames of a sequence after its trigger, each in its place.

use super::judge::{judge, judge_counted};
use super::{Fault, Progress, Scanner};
use crate::clock::monotonic_ns;
use crate::consistency;
use crate::control::Settings;
use crate::{Camera, CommandPort};
use phasmid_core::error::{Error, Result};
use phasmid_pattern::Manifest;
use phasmid_protocol::Frame;
use std::time::{Duration, Instant};

/// How long the camera has to be silent before a run starts, and after one whose frames only count.
const QUIET: Duration = Duration::from_millis(20);
/// Bytes that a run's frames may take in memory, as many as the decoder takes from files.
const MAX_BYTES: u64 = 4 << 30;
/// Frames are timed by another clock when they are as far from the present.
const PLAUSIBLE_NS: u64 = 10_000_000_000;
/// A driver's time may be so coarse, and so much too early.
const TIMING_NS: u64 = 1_000_000;

/// What a run waits for.
pub(super) struct Wanted {
    /// Frames.
    pub count: usize,
    /// Columns and rows, where they are known.
    pub size: Option<(u32, u32)>,
    /// Id of the last frame before the run.
    pub stale: Option<u64>,
    /// When the run was triggered, on the monotonic clock.
    pub since_ns: u64,
    /// How long to wait for a frame.
    pub timeout: Duration,
    /// The camera shows no pattern of its own accord: frames are taken as they come.
    pub free: bool,
}

impl<C: Camera, P: CommandPort> Scanner<C, P> {
    /// Arms, triggers and captures; `settings` are those of the run, and have to be so after it.
    pub(super) fn run(
        &mut self,
        manifest: &Manifest,
        settings: &Settings,
        size: Option<(u32, u32)>,
        timeout: Duration,
        progress: &mut dyn FnMut(Progress<'_>),
    ) -> Result<Vec<Frame>, Fault> {
        let count = manifest.frame.len();
        if let Some((width, height)) = size {
            // Refused before anything is exposed; a pixel takes a byte at least.
            check_room(
                self.camera.info(),
                count,
                u64::from(width) * u64::from(height),
            )?;
        }
        // Answered when the last frame of an earlier run has left the device.
        self.control.settle().map_err(Fault::port)?;
        let stale = drain(&mut self.camera, timeout)?;
        self.control.arm().map_err(Fault::port)?;
        let since_ns = monotonic_ns();
        self.control.trigger().map_err(Fault::port)?;
        let wanted = Wanted {
            count,
            size,
            stale,
            since_ns,
            timeout,
            free: false,
        };
        let frames = collect(&mut self.camera, &wanted, progress);
        if let Err(fault @ (Fault::Fatal(_) | Fault::Camera(_))) = frames {
            return Err(fault);
        }
        // Frames that came and those that did not are the run's only if the device was what it was
        // set to be all the time; and it may know why some did not come.
        self.control.confirm(settings).map_err(Fault::port)?;
        self.control.complaints().map_err(Fault::port)?;
        let frames = frames?;
        if !self.camera.identifies()
            && let Some(frame) = next_frame(&mut self.camera, QUIET)?
        {
            return Err(Fault::Frames(format!(
                "frame {} is foreign: all {count} patterns had come",
                frame.id
            )));
        }
        if !self.checks {
            return Ok(frames);
        }
        // Which frame it is does not tell whether it is a good one.
        let check = match self.camera.identifies() {
            true => consistency::check_identified,
            false => consistency::check,
        };
        check(manifest, &frames).map_err(Fault::Frames)?;
        Ok(frames)
    }
}

/// Takes the frames of a run.
pub(super) fn collect<C: Camera>(
    camera: &mut C,
    wanted: &Wanted,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Vec<Frame>, Fault> {
    let Wanted {
        count,
        timeout,
        size,
        ..
    } = *wanted;
    let mut frames: Vec<Frame> = Vec::with_capacity(count);
    let begin = Instant::now();
    while frames.len() < count {
        let Some(frame) = next_frame(camera, timeout)? else {
            let due = frames.len();
            let waited = timeout.as_secs_f64();
            return Err(Fault::Frames(format!(
                "pattern {due} of {count} is missing: no frame within {waited} s after {due} of \
                 {count} frames"
            )));
        };
        let named = camera.identifies();
        let verdict = if named && wanted.free && frames.is_empty() && frame.pattern_index != Some(0)
        {
            // The sequence has not begun.
            if begin.elapsed() > timeout {
                let what = "frames without the first of a sequence among them";
                return Err(Fault::Frames(what.to_owned()));
            }
            continue;
        } else if named {
            judge(&frame, &frames, wanted.stale, size)
        } else if is_early(&frame, wanted.since_ns) {
            if begin.elapsed() > timeout {
                let what = "frames that the camera took before the trigger, and no others";
                return Err(Fault::Frames(what.to_owned()));
            }
            continue;
        } else {
            judge_counted(&frame, &frames, size)
        };
        verdict.map_err(Fault::Frames)?;
        // The others have the first one's size and format, or are refused.
        if frames.is_empty() {
            check_room(camera.info(), count, frame.data.len() as u64)?;
        }
        frames.push(frame);
        progress(Progress::Frame {
            done: frames.len(),
            of: count,
        });
    }
    Ok(frames)
}

/// Whether a frame that only counts was taken before `since_ns`. Where the driver's clock is not the
/// monotonic one, its times are far away, and nobody knows.
fn is_early(frame: &Frame, since_ns: u64) -> bool {
    let taken_ns = frame.exposure_end_ns;
    taken_ns.abs_diff(since_ns) < PLAUSIBLE_NS && taken_ns < since_ns.saturating_sub(TIMING_NS)
}

/// Whether memory has room for `count` frames of so many bytes.
fn check_room(camera: &str, count: usize, bytes: u64) -> Result<()> {
    let all = bytes.saturating_mul(count as u64);
    if all <= MAX_BYTES {
        return Ok(());
    }
    Err(Error::device(format!(
        "{camera}: {count} frames of {bytes} bytes are {} MiB in all, at most {} MiB are taken",
        all >> 20,
        MAX_BYTES >> 20
    )))
}

/// Takes frames that were under way until none comes; gives the last one's id.
fn drain<C: Camera>(camera: &mut C, timeout: Duration) -> Result<Option<u64>, Fault> {
    let end = Instant::now() + timeout;
    let mut last = None;
    loop {
        match next_frame(camera, QUIET) {
            Ok(None) => return Ok(last),
            Ok(Some(frame)) => last = Some(frame.id),
            // Damaged, but nobody wants it.
            Err(Fault::Frames(_)) => {}
            Err(fatal) => return Err(fatal),
        }
        if Instant::now() > end {
            return Err(Fault::Frames(format!(
                "foreign frames: the camera runs free, waited {} s for silence; is it the camera \
                 of the device at the control port?",
                timeout.as_secs_f64()
            )));
        }
    }
}

/// The camera's next frame; a damaged one is the run's fault, not the end.
pub(super) fn next_frame<C: Camera>(
    camera: &mut C,
    timeout: Duration,
) -> Result<Option<Frame>, Fault> {
    let frame = camera.next_frame(timeout);
    frame.map_err(|error| match (camera.has_skipped(), camera.has_gone()) {
        (true, _) => Fault::Frames(error.to_string()),
        (false, true) => Fault::Camera(error),
        (false, false) => Fault::Fatal(error),
    })
}
