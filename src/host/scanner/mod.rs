//! A scanner: a camera and a command port that belong together. It runs a sequence and captures
//! each frame by its id; from a camera whose frames have none, by the contract that a trigger gives
//! as many frames as the sequence has, in order, and nothing else.

mod device;
mod free;
mod judge;
mod run;

pub use free::scan_free_running;

use super::control::{Control, RECOVERIES, both};
use super::{Camera, Captured, CommandPort, Instrument};
use device::check_size;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::Rig;
use phasmid_pattern::Manifest;
use phasmid_protocol::dialect::Dialect;
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
    /// A run failed for this reason, and another one starts.
    Retry(&'a str),
}

/// A device that scans.
pub struct Scanner<C, P> {
    camera: C,
    control: Control<P>,
    /// The trigger source as it was found, where the device says so.
    source: Option<String>,
    /// Who the device is, once it has said so.
    idn: Option<String>,
    /// A calibration in place of the device's own, and where it came from.
    given: Option<(String, Rig)>,
    /// The device has been looked for, and not been found.
    lost: bool,
    /// Whether frames are checked against the sequence before they are handed out.
    checks: bool,
}

/// Why a run gave no capture.
enum Fault {
    /// A frame is missing, repeated, foreign or damaged: another run may do better.
    Frames(String),
    /// The device at the control port is silent, has gone, or does not stay as it was set: once it
    /// is found again, another run may do better.
    Port(Error),
    /// The camera was unplugged: once it is found again, another run may do better.
    Camera(Error),
    /// Anything else.
    Fatal(Error),
}

impl Fault {
    /// What the control port's failure means: a mistake of the user's stays one.
    fn port(error: Error) -> Self {
        match error {
            Error::Input { .. } => Self::Fatal(error),
            error => Self::Port(error),
        }
    }
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
        Err(Fault::Fatal(error) | Fault::Port(error) | Fault::Camera(error)) => return Err(error),
        Err(Fault::Frames(first)) => first,
    };
    progress(Progress::Retry(&first));
    run(progress).map_err(|fault| match fault {
        Fault::Fatal(error) | Fault::Port(error) | Fault::Camera(error) => error,
        Fault::Frames(second) => two_failed(place, &first, &second),
    })
}

fn two_failed(place: &str, first: &str, second: &str) -> Error {
    Error::device(format!(
        "{place}: two runs failed; first: {first}; then: {second}"
    ))
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
        Self::with_dialect(port, None, timeout, open_camera)
    }

    /// [`Self::new`] for a device that speaks another dialect than SCPI.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn with_dialect(
        port: P,
        dialect: Option<Dialect>,
        timeout: Duration,
        open_camera: impl FnOnce() -> Result<C>,
    ) -> Result<Self> {
        let mut control = Control::open(port, dialect, timeout)?;
        let source = control.persist(Control::source)?;
        control.persist(Control::quiet)?;
        let camera = match open_camera() {
            Ok(camera) => camera,
            Err(error) => {
                if let Some(source) = &source {
                    // The camera's error is the one to tell.
                    let _ = control.restore(source);
                }
                return Err(error);
            }
        };
        Ok(Self {
            camera,
            control,
            source,
            idn: None,
            given: None,
            lost: false,
            checks: true,
        })
    }

    /// Hands frames out as they came: for one who checks them while the next scan goes on
    /// ([`check_sequence`](crate::check_sequence)), and leaves a bad one out instead of having it
    /// taken again.
    #[must_use]
    pub fn without_checks(mut self) -> Self {
        self.checks = false;
        self
    }

    /// Whether frames say which they are (see [`Camera::identifies`]).
    pub fn identifies(&self) -> bool {
        self.camera.identifies()
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
        match &self.source {
            // It has been waited for, and the scan has said so.
            Some(source) if self.lost => {
                let _ = self.control.restore(source);
                Ok(())
            }
            Some(source) => self.control.persist(|control| control.restore(source)),
            None => Ok(()),
        }
    }

    /// Name of the sequence that is selected, where the device says so.
    ///
    /// # Errors
    /// What the port or the device refuses.
    pub fn selected(&mut self) -> Result<Option<String>> {
        self.control.persist(Control::selection)
    }

    /// Selects a sequence; a scan does so by itself.
    ///
    /// # Errors
    /// What the port or the device refuses, and a sequence that it does not have.
    pub fn select(&mut self, name: &str) -> Result<()> {
        self.control.persist(|control| control.select(name))
    }

    /// The device's control port where it speaks SCPI, to set what a scan leaves alone: exposure,
    /// gain, light.
    pub fn instrument(&mut self) -> Option<&mut Instrument<P>> {
        self.control.instrument()
    }

    /// Captures a sequence. A run with a missing, repeated, foreign or damaged frame is repeated
    /// once; one in which the control port failed, or after which the device is not as it was set,
    /// twice, once the device has been found again; and one in which the camera was unplugged twice,
    /// once it has come back.
    ///
    /// # Errors
    /// A device that refuses, is silent, says what cannot be understood, or goes on failing; each
    /// with what was waited for and how long.
    pub fn scan(
        &mut self,
        options: &ScanOptions,
        progress: &mut dyn FnMut(Progress<'_>),
    ) -> Result<Captured> {
        let mut sequence = options.sequence.clone();
        let mut first: Option<String> = None;
        let (mut recoveries, mut returns) = (0, 0);
        loop {
            match self.attempt(options, &mut sequence, progress) {
                Ok(captured) => return Ok(captured),
                Err(Fault::Fatal(error)) => return Err(error),
                Err(Fault::Frames(why)) => {
                    if let Some(first) = first {
                        return Err(two_failed(self.camera.info(), &first, &why));
                    }
                    progress(Progress::Retry(&why));
                    first = Some(why);
                }
                Err(Fault::Port(error)) if recoveries == RECOVERIES => return Err(error),
                Err(Fault::Port(error)) => {
                    recoveries += 1;
                    let found = self.control.recover();
                    self.found(&error, found)?;
                    progress(Progress::Retry(&error.to_string()));
                }
                Err(Fault::Camera(error)) if returns == RECOVERIES => return Err(error),
                Err(Fault::Camera(error)) => {
                    returns += 1;
                    let found = self.plug_in(options.frame_timeout);
                    self.found(&error, found)?;
                    progress(Progress::Retry(&error.to_string()));
                }
            }
        }
    }

    /// Finds a device again whose camera has gone. The port of a device that has both has gone too,
    /// and the device is told to be quiet before its camera is opened, as at the beginning.
    fn plug_in(&mut self, timeout: Duration) -> Result<()> {
        self.control.recover()?;
        self.control.persist(Control::quiet)?;
        self.camera.reopen(timeout)
    }

    /// Notes whether a device that failed has been found again.
    fn found(&mut self, error: &Error, found: Result<()>) -> Result<()> {
        self.lost = found.is_err();
        found.map_err(|then| both(error, &then))
    }

    /// One run from the first setting on. `sequence` is the one to select: where none is wanted, the
    /// one that was found selected, for a device that was reset has forgotten it.
    fn attempt(
        &mut self,
        options: &ScanOptions,
        sequence: &mut Option<String>,
        progress: &mut dyn FnMut(Progress<'_>),
    ) -> Result<Captured, Fault> {
        let idn = self.control.identify().map_err(Fault::port)?;
        match &self.idn {
            None => progress(Progress::Identified(&idn)),
            Some(before) if *before != idn => {
                return Err(Fault::Fatal(Error::device(format!(
                    "another device answers at the control port: {idn:?}, and {before:?} before"
                ))));
            }
            Some(_) => {}
        }
        self.idn = Some(idn.clone());
        let settings = self.control.prepare(sequence.as_deref());
        let settings = settings.map_err(Fault::port)?;
        if sequence.is_none() {
            // Of a name with a wrong letter another sequence might be selected later.
            self.control.confirm(&settings).map_err(Fault::port)?;
            *sequence = self.control.selected(&settings);
        }
        let manifest = self.manifest(options).map_err(Fault::port)?;
        let calibration = self.calibration().map_err(Fault::port)?;
        if let (Some((place, given)), Some(own)) = (&self.given, &calibration) {
            check_size(place, given, own)?;
        }
        let size = calibration.map(|rig| (rig.camera.lens.width_px, rig.camera.lens.height_px));
        let frames = self.run(&manifest, &settings, size, options.frame_timeout, progress)?;
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
