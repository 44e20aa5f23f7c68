//! Capture without a control port, from a free-running camera.

use super::run::{Wanted, collect, next_frame, unpacked};
use super::{Fault, Flow, Progress, Watch, twice};
use crate::Camera;
use crate::time::monotonic_ns;
use phasmid_core::error::Result;
use phasmid_decode::{Capture, Known, check_sequence};
use phasmid_pattern::Manifest;
use std::time::Duration;

/// Maximum time until a frame that is already waiting is delivered. A camera that reads in a thread of
/// its own does not deliver it at once.
const WAKE: Duration = Duration::from_millis(2);
/// Maximum number of frames waiting in a driver.
const WAITING: usize = 64;

/// The device's identity as stored with a capture without a control port, in place of the answer to
/// `*IDN?`.
const NOBODY: &str = "no control port";

/// Captures as many consecutive frames as `manifest` has, from a camera that is not triggered by
/// this program: the user starts the sequence. Frames that were already waiting in the driver are
/// discarded. A run that lost a frame is repeated once.
///
/// # Errors
/// Returns an error if the camera fails or delivers no frame within `timeout`, or if the frames do
/// not match the manifest.
pub fn scan_free_running<C: Camera, F: Flow>(
    camera: &mut C,
    manifest: &Manifest,
    timeout: Duration,
    progress: &mut (impl FnMut(Progress<'_>) -> F + ?Sized),
) -> Result<Capture> {
    let progress: &mut Watch<'_> = &mut |what: Progress<'_>| progress(what).flow();
    let info = camera.info().to_owned();
    let (images, frames) = twice(&info, progress, |progress| {
        for _ in 0..WAITING {
            match next_frame(camera, WAKE, progress) {
                Ok(None) => break,
                // Discard a damaged frame like an intact one.
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
        let (images, frames) = unpacked(collect(camera, &wanted, progress)?)?;
        let known = Known::new(camera.identifies(), None);
        check_sequence(manifest, &images, known)
            .map_err(|doubt| Fault::Frames(doubt.to_string()))?;
        Ok((images, frames))
    })?;
    Ok(Capture {
        idn: NOBODY.to_owned(),
        manifest: manifest.clone(),
        calibration: None,
        images,
        frames,
    })
}
