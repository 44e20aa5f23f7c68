//! A capture without a control port: the frames of a camera that runs free, as they come.

use super::run::{Wanted, collect, next_frame};
use super::{Fault, Progress, twice};
use crate::clock::monotonic_ns;
use crate::{Camera, Captured, consistency};
use phasmid_core::error::Result;
use phasmid_pattern::Manifest;
use std::time::Duration;

/// A frame that waits is there within this time, even where a thread fetches it.
const WAKE: Duration = Duration::from_millis(2);
/// Most frames that wait in a driver.
const WAITING: usize = 64;

/// What stands for `*IDN?` where nobody was asked.
const NOBODY: &str = "no control port";

/// Captures as many frames as `manifest` has, as they come, from a camera that nobody triggers: it
/// is for the user to start the sequence. Frames that were waiting in the driver are left out. A run
/// that lost a frame is repeated once.
///
/// # Errors
/// A camera that is silent for `timeout` or fails, and frames that are not those of the manifest.
pub fn scan_free_running<C: Camera>(
    camera: &mut C,
    manifest: &Manifest,
    timeout: Duration,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Captured> {
    let info = camera.info().to_owned();
    let frames = twice(&info, progress, |progress| {
        for _ in 0..WAITING {
            match next_frame(camera, WAKE) {
                Ok(None) => break,
                // Damaged, but nobody wants it.
                Ok(Some(_)) | Err(Fault::Frames(_)) => {}
                Err(fatal) => return Err(fatal),
            }
        }
        let wanted = Wanted {
            count: manifest.frame.len(),
            size: None,
            stale: None,
            since_ns: monotonic_ns(),
            timeout,
            free: true,
        };
        let frames = collect(camera, &wanted, progress)?;
        let check = match camera.identifies() {
            true => consistency::check_identified,
            false => consistency::check,
        };
        check(manifest, &frames).map_err(Fault::Frames)?;
        Ok(frames)
    })?;
    Ok(Captured {
        idn: NOBODY.to_owned(),
        manifest: manifest.clone(),
        calibration: None,
        frames,
    })
}
