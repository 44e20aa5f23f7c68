//! A scanner: a camera and a command port that belong together. It runs a sequence and captures
//! each frame by its id; from a camera whose frames have none, by the contract that a trigger gives
//! as many frames as the sequence has, in order, and nothing else.

mod device;
mod free;
mod judge;
mod run;

pub use free::scan_free_running;

use super::{Camera, Captured, CommandPort, Instrument};
use crate::error::{Error, Result};
use crate::geometry::Rig;
use crate::pattern::Manifest;
use device::check_size;
use std::time::Duration;

/// How to scan.
#[derive(Debug, Clone)]
pub struct ScanOptions {
    /// The sequence to select; the one that is selected when absent.
    pub sequence: Option<String>,
    /// What the device projects, where it does not say so itself.
    pub manifest: Option<Manifest>,
    /// How long to wait for a frame, from the trigger or the frame before it.
    pub frame_timeout: Duration,
}

/// How far a scan has got.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress<'a> {
    /// The device has said who it is.
    Identified(&'a str),
    /// So many of so many frames are there.
    Frame {
        /// Frames captured.
        done: usize,
        /// Frames of the sequence.
        of: usize,
    },
    /// A run failed for this reason, and a second one starts.
    Retry(&'a str),
}

/// A device that scans.
pub struct Scanner<C, P> {
    camera: C,
    instrument: Instrument<P>,
    /// `TRIGger:SOURce` as it was found.
    source: String,
    /// A calibration in place of the device's own, and where it came from.
    given: Option<(String, Rig)>,
}

/// Why a run gave no capture.
enum Fault {
    /// A frame is missing, repeated, foreign or damaged: another run may do better.
    Frames(String),
    /// Anything else.
    Fatal(Error),
}

impl From<Error> for Fault {
    fn from(error: Error) -> Self {
        Self::Fatal(error)
    }
}

/// Gives a run that lost a frame a second chance; `place` names the camera.
fn twice<T>(
    place: &str,
    progress: &mut dyn FnMut(Progress<'_>),
    mut run: impl FnMut(&mut dyn FnMut(Progress<'_>)) -> Result<T, Fault>,
) -> Result<T> {
    let first = match run(progress) {
        Ok(done) => return Ok(done),
        Err(Fault::Fatal(error)) => return Err(error),
        Err(Fault::Frames(first)) => first,
    };
    progress(Progress::Retry(&first));
    run(progress).map_err(|fault| match fault {
        Fault::Fatal(error) => error,
        Fault::Frames(second) => Error::device(format!(
            "{place}: two runs failed; first: {first}; then: {second}"
        )),
    })
}

/// Makes a device expose nothing but what it is triggered to.
///
/// # Errors
/// What the device refuses.
fn quiet<P: CommandPort>(instrument: &mut Instrument<P>) -> Result<()> {
    instrument.order("INIT:CONT OFF;:ABOR;:TRIG:SOUR BUS;MODE SEQ")
}

/// Leaves the trigger source as it was found.
fn restore<P: CommandPort>(instrument: &mut Instrument<P>, source: &str) -> Result<()> {
    // It came from the device, but it is not sent back unread.
    if !source.is_empty() && source.chars().all(|c| c.is_ascii_alphanumeric()) {
        instrument.order(&format!("ABOR;:TRIG:SOUR {source}"))?;
    }
    Ok(())
}

impl<C: Camera, P: CommandPort> Scanner<C, P> {
    /// Puts a scanner together. The device is told to stop running free before `open_camera` is
    /// called, so that the camera has nothing to say yet when it is opened.
    ///
    /// # Errors
    /// What the port, the device or the camera refuses.
    pub fn new(
        port: P,
        timeout: Duration,
        open_camera: impl FnOnce() -> Result<C>,
    ) -> Result<Self> {
        let mut instrument = Instrument::open(port, timeout)?;
        let source = instrument.query("TRIG:SOUR?")?;
        quiet(&mut instrument)?;
        let camera = match open_camera() {
            Ok(camera) => camera,
            Err(error) => {
                // The camera's error is the one to tell.
                let _ = restore(&mut instrument, &source);
                return Err(error);
            }
        };
        Ok(Self {
            camera,
            instrument,
            source,
            given: None,
        })
    }

    /// Uses a calibration in place of the device's own; `place` names it in messages. One that says
    /// nothing of the camera's noise, as OpenCV's files do not, leaves the device's word on that.
    #[must_use]
    pub fn with_calibration(mut self, place: impl Into<String>, rig: Rig) -> Self {
        self.given = Some((place.into(), rig));
        self
    }

    /// Lets go of the camera and leaves the trigger source as it was found: a camera that ran free
    /// does so again.
    ///
    /// # Errors
    /// What the port or the device refuses.
    pub fn finish(mut self) -> Result<()> {
        drop(self.camera);
        restore(&mut self.instrument, &self.source)
    }

    /// The device's control port, to set what a scan leaves alone: exposure, gain, light.
    pub fn instrument(&mut self) -> &mut Instrument<P> {
        &mut self.instrument
    }

    /// Captures a sequence. A run with a missing, repeated, foreign or damaged frame is
    /// repeated once.
    ///
    /// # Errors
    /// A device that refuses, is silent, says what cannot be understood, or fails twice; each with
    /// what was waited for and how long.
    pub fn scan(
        &mut self,
        options: &ScanOptions,
        progress: &mut dyn FnMut(Progress<'_>),
    ) -> Result<Captured> {
        let idn = self.identify()?;
        progress(Progress::Identified(&idn));
        quiet(&mut self.instrument)?;
        self.instrument.order("PROJ:POW ON")?;
        if let Some(name) = &options.sequence {
            self.select(name)?;
        }
        let manifest = self.manifest(options)?;
        let calibration = self.calibration()?;
        if let (Some((place, given)), Some(own)) = (&self.given, &calibration) {
            check_size(place, given, own)?;
        }
        let size = calibration.map(|rig| (rig.camera.lens.width_px, rig.camera.lens.height_px));
        let place = self.camera.info().to_owned();
        let frames = twice(&place, progress, |progress| {
            self.run(&manifest, size, options.frame_timeout, progress)
        })?;
        let noise = calibration.and_then(|own| own.noise);
        let given = self.given.as_ref().map(|(_, given)| Rig {
            noise: given.noise.or(noise),
            ..*given
        });
        Ok(Captured {
            idn,
            manifest,
            calibration: given.or(calibration),
            frames,
        })
    }
}
