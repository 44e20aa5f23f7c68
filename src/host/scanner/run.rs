//! A single run: collects the frames of a sequence after its trigger, in order.

use super::judge::{judge, judge_counted};
use super::{Fault, Progress, Scanner, Watch, report};
use crate::control::Settings;
use crate::time::monotonic_ns;
use crate::{Camera, CommandPort};
use phasmid_core::error::{Error, Result};
use phasmid_decode::{FrameInfo, Known, check_sequence};
use phasmid_geometry::Rig;
use phasmid_pattern::{Image, Manifest};
use phasmid_protocol::Frame;
use std::time::{Duration, Instant};

/// Time for which the camera must deliver no frame before a run, and also after a run if its frames
/// carry no identity.
const QUIET: Duration = Duration::from_millis(20);
/// Time between two reports while a frame is awaited.
const SLICE: Duration = Duration::from_millis(100);
/// Maximum memory for the frames of a run, in bytes. The decoder has the same limit for frames in
/// files.
const MAX_BYTES: u64 = 4 << 30;
/// Minimum distance of a frame's timestamp from the trigger, in nanoseconds, at which the driver is
/// assumed to use a clock other than the monotonic one.
const PLAUSIBLE_NS: u64 = 10_000_000_000;
/// Tolerance in nanoseconds for driver timestamps that are coarse or too early.
const TIMING_NS: u64 = 1_000_000;

/// Expected frames of a run.
pub(super) struct Wanted {
    /// Number of frames.
    pub count: usize,
    /// Width and height in pixels, if known.
    pub size: Option<(u32, u32)>,
    /// Id of the last frame that was received before the run.
    pub stale: Option<u64>,
    /// Time of the trigger, on the monotonic clock.
    pub since_ns: u64,
    /// Maximum time to wait for a frame.
    pub timeout: Duration,
    /// The run was not triggered by this program, so frames are taken as they come.
    pub free: bool,
}

impl<C: Camera, P: CommandPort> Scanner<C, P> {
    /// Arms, triggers and captures; `settings` are the settings before the run, which must be
    /// unchanged after it.
    pub(super) fn run(
        &mut self,
        manifest: &Manifest,
        settings: &Settings,
        calibration: Option<&Rig>,
        timeout: Duration,
        progress: &mut Watch<'_>,
    ) -> Result<(Vec<Image>, Vec<FrameInfo>), Fault> {
        let count = manifest.frame.len();
        let lens = calibration.map(|rig| &rig.camera.lens);
        let size = lens.map(|lens| (lens.width_px, lens.height_px));
        if let Some((width, height)) = size {
            // Check the memory before anything is exposed. A pixel takes at least one byte.
            check_room(
                self.camera.info(),
                count,
                u64::from(width) * u64::from(height),
            )?;
        }
        // The device answers this query once the last frame of an earlier run has left it.
        self.control.settle().map_err(Fault::port)?;
        let stale = drain(&mut self.camera, timeout, progress)?;
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
        // The frames, or their absence, count only if the device kept its settings throughout the
        // run. The device's error queue may also state why frames are missing.
        self.control.confirm(settings).map_err(Fault::port)?;
        self.control.complaints().map_err(Fault::port)?;
        let frames = frames?;
        if !self.camera.identifies()
            && let Some(frame) = next_frame(&mut self.camera, QUIET, progress)?
        {
            return Err(Fault::Frames(format!(
                "frame {} is foreign: all {count} patterns had arrived",
                frame.id
            )));
        }
        let (images, frames) = unpacked(frames)?;
        if !self.checks {
            return Ok((images, frames));
        }
        // The identity of a frame does not say whether its content is good.
        let known = Known::new(self.camera.identifies(), calibration);
        check_sequence(manifest, &images, known)
            .map_err(|doubt| Fault::Frames(doubt.to_string()))?;
        Ok((images, frames))
    }
}

/// Collects the frames of a run.
pub(super) fn collect<C: Camera>(
    camera: &mut C,
    wanted: &Wanted,
    progress: &mut Watch<'_>,
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
        let Some(frame) = next_frame(camera, timeout, progress)? else {
            let due = frames.len();
            let waited = timeout.as_secs_f64();
            let cause = match due {
                0 => ": the camera was not triggered, or the device's clock stands still",
                _ => "",
            };
            return Err(Fault::Frames(format!(
                "pattern {due} of {count} is missing: no frame within {waited} s after {due} of \
                 {count} frames{cause}"
            )));
        };
        let named = camera.identifies();
        let verdict = if named && wanted.free && frames.is_empty() && frame.pattern_index != Some(0)
        {
            // The sequence has not started yet.
            if begin.elapsed() > timeout {
                let what = "no frame shows the first pattern of the sequence";
                return Err(Fault::Frames(what.to_owned()));
            }
            continue;
        } else if named {
            judge(&frame, &frames, wanted.stale, size)
        } else if is_early(&frame, wanted.since_ns) {
            if begin.elapsed() > timeout {
                let what = "only frames that the camera took before the trigger";
                return Err(Fault::Frames(what.to_owned()));
            }
            continue;
        } else {
            judge_counted(&frame, &frames, size)
        };
        verdict.map_err(Fault::Frames)?;
        // All later frames must have the size and format of the first frame.
        if frames.is_empty() {
            check_room(camera.info(), count, frame.data.len() as u64)?;
        }
        frames.push(frame);
        let (done, of) = (frames.len(), count);
        report(progress, Progress::Frame { done, of })?;
    }
    Ok(frames)
}

/// Splits frames into images and frame information (id, pattern index and times).
pub(super) fn unpacked(frames: Vec<Frame>) -> Result<(Vec<Image>, Vec<FrameInfo>)> {
    let info = |frame: &Frame| FrameInfo {
        id: frame.id,
        pattern_index: frame.pattern_index,
        exposure_start_ns: frame.exposure_start_ns,
        exposure_end_ns: frame.exposure_end_ns,
    };
    let infos = frames.iter().map(info).collect();
    let images = frames.into_iter().map(Frame::into_image);
    Ok((images.collect::<Result<_>>()?, infos))
}

/// Returns whether a frame without identity was taken before `since_ns`. If the frame's timestamp
/// is far from the present, the driver does not use the monotonic clock; the result is then
/// `false`.
fn is_early(frame: &Frame, since_ns: u64) -> bool {
    let taken_ns = frame.exposure_end_ns;
    taken_ns.abs_diff(since_ns) < PLAUSIBLE_NS && taken_ns < since_ns.saturating_sub(TIMING_NS)
}

/// Checks that `count` frames of `bytes` bytes each fit into memory.
fn check_room(camera: &str, count: usize, bytes: u64) -> Result<()> {
    let all = bytes.saturating_mul(count as u64);
    if all <= MAX_BYTES {
        return Ok(());
    }
    Err(Error::device(format!(
        "{camera}: {count} frames of {bytes} bytes are {} MiB in all, expected at most {} MiB",
        all >> 20,
        MAX_BYTES >> 20
    )))
}

/// Discards frames in transit until no more come; returns the id of the last discarded frame.
fn drain<C: Camera>(
    camera: &mut C,
    timeout: Duration,
    progress: &mut Watch<'_>,
) -> Result<Option<u64>, Fault> {
    let end = Instant::now() + timeout;
    let mut last = None;
    loop {
        match next_frame(camera, QUIET, progress) {
            Ok(None) => return Ok(last),
            Ok(Some(frame)) => last = Some(frame.id),
            // Discard a damaged frame like an intact one.
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

/// Returns the camera's next frame. A damaged frame fails the run, which may be repeated.
pub(super) fn next_frame<C: Camera>(
    camera: &mut C,
    timeout: Duration,
    progress: &mut Watch<'_>,
) -> Result<Option<Frame>, Fault> {
    let mut left = timeout;
    loop {
        report(progress, Progress::Waiting)?;
        // Count slices instead of measuring real time, because a device in memory lets its time pass
        // without waiting.
        let slice = left.min(SLICE);
        left -= slice;
        let frame = camera.next_frame(slice);
        let frame = frame.map_err(|error| match (camera.has_skipped(), camera.has_gone()) {
            (true, _) => Fault::Frames(error.to_string()),
            (false, true) => Fault::Camera(error),
            (false, false) => Fault::Fatal(error),
        })?;
        if frame.is_some() || left.is_zero() {
            return Ok(frame);
        }
    }
}
