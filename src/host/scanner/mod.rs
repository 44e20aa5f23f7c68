//! A scanner: a camera and a command port that belong together. It runs a sequence and captures
//! each frame by its id. For a camera whose frames have no id, it relies on the contract that a
//! trigger produces exactly the frames of the sequence, in order.

mod free;
mod judge;
mod run;

pub use free::scan_free_running;

use super::control::{Control, RECOVERIES, both};
use super::{Camera, CommandPort, Instrument};
use phasmid_core::error::{Error, Result};
use phasmid_decode::Capture;
use phasmid_geometry::Rig;
use phasmid_pattern::Manifest;
use phasmid_protocol::dialect::Dialect;
use std::ops::ControlFlow;
use std::time::Duration;

/// Options for a scan.
#[derive(Debug, Clone)]
pub struct ScanOptions {
    /// The sequence to select; `None` keeps the selected one.
    pub sequence: Option<String>,
    /// The manifest of the projected sequence, for a device that does not provide it.
    pub manifest: Option<Manifest>,
    /// Maximum time to wait for a frame, from the trigger or the preceding frame.
    pub frame_timeout: Duration,
}

/// Progress of a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress<'a> {
    /// The device has identified itself.
    Identified(&'a str),
    /// A frame was captured.
    Frame {
        /// Number of frames captured.
        done: usize,
        /// Number of frames in the sequence.
        of: usize,
    },
    /// A run failed for this reason and is repeated.
    Retry(&'a str),
    /// The scan is waiting for a frame; reported at least ten times a second.
    Waiting,
}

/// Return type of a progress function: `()`, or a `ControlFlow` that may end the scan.
pub trait Flow {
    /// Returns whether the scan goes on.
    fn flow(self) -> ControlFlow<()>;
}

impl Flow for () {
    fn flow(self) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

impl Flow for ControlFlow<()> {
    fn flow(self) -> ControlFlow<()> {
        self
    }
}

/// A function that receives the progress of a scan and returns whether the scan goes on.
type Watch<'a> = dyn FnMut(Progress<'_>) -> ControlFlow<()> + 'a;

/// Reports progress; returns an error if `watch` asks to end the scan.
fn report(watch: &mut Watch<'_>, progress: Progress<'_>) -> Result<()> {
    match watch(progress) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Error::Interrupted),
    }
}

/// A device that can scan.
pub struct Scanner<C, P> {
    camera: C,
    control: Control<P>,
    /// The trigger source that the device had when it was opened, if the device reports it.
    source: Option<String>,
    /// The device's identity, once it has been read.
    idn: Option<String>,
    /// A calibration that replaces the device's own, with its origin for messages.
    given: Option<(String, Rig)>,
    /// Recovery was tried and the device was not found.
    lost: bool,
    /// Whether the contents of the frames are checked against the sequence before the frames are
    /// returned.
    checks: bool,
}

/// Why a run produced no capture.
enum Fault {
    /// A frame is missing, repeated, foreign or damaged: another run may succeed.
    Frames(String),
    /// The device on the control port does not answer, is gone, or does not keep its settings: once
    /// it is found again, another run may succeed.
    Port(Error),
    /// The camera was unplugged: once it is found again, another run may succeed.
    Camera(Error),
    /// Any other error.
    Fatal(Error),
}

impl Fault {
    /// Classifies a control port error; an input error is the user's mistake and stays fatal.
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

/// Performs a run, and repeats it once if it lost a frame; `place` names the camera in messages.
fn twice<T>(
    place: &str,
    progress: &mut Watch<'_>,
    mut run: impl FnMut(&mut Watch<'_>) -> Result<T, Fault>,
) -> Result<T> {
    let first = match run(progress) {
        Ok(done) => return Ok(done),
        Err(Fault::Fatal(error) | Fault::Port(error) | Fault::Camera(error)) => return Err(error),
        Err(Fault::Frames(first)) => first,
    };
    report(progress, Progress::Retry(&first))?;
    run(progress).map_err(|fault| match fault {
        Fault::Fatal(error) | Fault::Port(error) | Fault::Camera(error) => error,
        Fault::Frames(second) => two_failed(place, &first, &second),
    })
}

fn two_failed(place: &str, first: &str, second: &str) -> Error {
    Error::device(match first == second {
        true => format!("{place}: two runs failed; both: {first}"),
        false => format!("{place}: two runs failed; first: {first}; then: {second}"),
    })
}

impl<C: Camera, P: CommandPort> Scanner<C, P> {
    /// Creates a scanner. Stops the device's free-running before it calls `open_camera`, so that
    /// the camera delivers no frames yet when it is opened.
    ///
    /// # Errors
    /// Returns an error if the port, the device or the camera fails or refuses.
    pub fn new(
        port: P,
        timeout: Duration,
        open_camera: impl FnOnce() -> Result<C>,
    ) -> Result<Self> {
        Self::with_dialect(port, None, timeout, open_camera)
    }

    /// Creates a scanner as [`Self::new`] does, for a device that speaks a dialect other than SCPI.
    ///
    /// # Errors
    /// Same as [`Self::new`].
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
                    // Report the camera's error rather than one from restoring the trigger source.
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

    /// Makes scans return frames unchecked, for a caller that checks them while the next scan is
    /// running ([`phasmid_decode::check_sequence`]) and skips a bad scan instead of repeating it.
    #[must_use]
    pub fn without_checks(mut self) -> Self {
        self.checks = false;
        self
    }

    /// Returns whether frames identify themselves (see [`Camera::identifies`]).
    pub fn identifies(&self) -> bool {
        self.camera.identifies()
    }

    /// Makes scans use this calibration instead of the device's own; `place` names it in messages.
    /// If it has no camera noise model (OpenCV files have none), the device's own noise model is
    /// used.
    #[must_use]
    pub fn with_calibration(mut self, place: impl Into<String>, rig: Rig) -> Self {
        self.given = Some((place.into(), rig));
        self
    }

    /// Closes the camera and restores the trigger source that the device had when it was opened, so
    /// that a camera that was free-running resumes.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    pub fn finish(mut self) -> Result<()> {
        drop(self.camera);
        match &self.source {
            // The scan has already reported that this device is lost, so ignore errors.
            Some(source) if self.lost => {
                let _ = self.control.restore(source);
                Ok(())
            }
            Some(source) => self.control.persist(|control| control.restore(source)),
            None => Ok(()),
        }
    }

    /// Returns the name of the selected sequence, if the device reports it.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    pub fn selected(&mut self) -> Result<Option<String>> {
        self.control.persist(Control::selection)
    }

    /// Selects a sequence now. A scan selects its sequence by itself.
    ///
    /// # Errors
    /// Returns an error if the port fails, the device refuses, or it does not have the sequence.
    pub fn select(&mut self, name: &str) -> Result<()> {
        self.control.persist(|control| control.select(name))
    }

    /// Returns the device's control port if it speaks SCPI, to change settings that a scan does not
    /// touch: exposure, gain, light.
    pub fn instrument(&mut self) -> Option<&mut Instrument<P>> {
        self.control.instrument()
    }

    /// Captures a sequence. A run is repeated once after a missing, repeated, foreign or damaged
    /// frame; up to twice after the control port failed or the device did not keep its settings,
    /// once the device has been found again; and up to twice after the camera was unplugged, once
    /// it has come back.
    ///
    /// `progress` may end the scan by returning `ControlFlow::Break`.
    ///
    /// Returns [`Error::Interrupted`] if `progress` ended it, or an error if the device refuses,
    /// does not answer, sends invalid data, or keeps failing; the message names the missing data
    /// and the time waited.
    pub fn scan<F: Flow>(
        &mut self,
        options: &ScanOptions,
        progress: &mut (impl FnMut(Progress<'_>) -> F + ?Sized),
    ) -> Result<Capture> {
        let progress: &mut Watch<'_> = &mut |what: Progress<'_>| progress(what).flow();
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
                    report(progress, Progress::Retry(&why))?;
                    first = Some(why);
                }
                Err(Fault::Port(error)) if recoveries == RECOVERIES => return Err(error),
                Err(Fault::Port(error)) => {
                    recoveries += 1;
                    let found = self.control.recover();
                    self.found(&error, found)?;
                    report(progress, Progress::Retry(&error.to_string()))?;
                }
                Err(Fault::Camera(error)) if returns == RECOVERIES => return Err(error),
                Err(Fault::Camera(error)) => {
                    returns += 1;
                    let found = self.plug_in(options.frame_timeout);
                    self.found(&error, found)?;
                    report(progress, Progress::Retry(&error.to_string()))?;
                }
            }
        }
    }

    /// Restores contact with a device whose camera is gone. The control port comes first, because
    /// if one device provides both, the port is gone too. As in [`Self::new`], free-running is
    /// stopped before the camera is opened.
    fn plug_in(&mut self, timeout: Duration) -> Result<()> {
        self.control.recover()?;
        self.control.persist(Control::quiet)?;
        self.camera.reopen(timeout)
    }

    /// Records whether the device was found again after `error`.
    fn found(&mut self, error: &Error, found: Result<()>) -> Result<()> {
        self.lost = found.is_err();
        found.map_err(|then| both(error, &then))
    }

    /// Performs one run, beginning with the device's settings. `sequence` is the sequence to
    /// select; `None` is replaced by the sequence that the device has selected, because a device
    /// that is reset forgets its selection.
    fn attempt(
        &mut self,
        options: &ScanOptions,
        sequence: &mut Option<String>,
        progress: &mut Watch<'_>,
    ) -> Result<Capture, Fault> {
        let idn = self.control.identify().map_err(Fault::port)?;
        match &self.idn {
            None => report(progress, Progress::Identified(&idn))?,
            Some(before) if *before != idn => {
                return Err(Fault::Fatal(Error::device(format!(
                    "another device answers at the control port: {idn:?}, previously {before:?}"
                ))));
            }
            Some(_) => {}
        }
        self.idn = Some(idn.clone());
        let settings = self.control.prepare(sequence.as_deref());
        let settings = settings.map_err(Fault::port)?;
        if sequence.is_none() {
            // Read the settings again before the name is kept: a name that was corrupted on the line
            // might select another sequence later.
            self.control.confirm(&settings).map_err(Fault::port)?;
            *sequence = self.control.selected(&settings);
        }
        let manifest = self.manifest(options).map_err(Fault::port)?;
        let calibration = self.calibration().map_err(Fault::port)?;
        if let (Some((place, given)), Some(own)) = (&self.given, &calibration) {
            check_size(place, given, own)?;
        }
        let timeout = options.frame_timeout;
        let (images, frames) = self.run(
            &manifest,
            &settings,
            calibration.as_ref(),
            timeout,
            progress,
        )?;
        let noise = calibration.and_then(|own| own.noise);
        let given = self.given.as_ref().map(|(_, given)| Rig {
            noise: given.noise.or(noise),
            ..*given
        });
        Ok(Capture {
            idn,
            manifest,
            calibration: given.or(calibration),
            images,
            frames,
        })
    }
}

impl<C: Camera, P: CommandPort> Scanner<C, P> {
    fn manifest(&mut self, options: &ScanOptions) -> Result<Manifest> {
        if let Some(manifest) = &options.manifest {
            return Ok(manifest.clone());
        }
        match self.control.manifest()? {
            // An invalid manifest from the device is not the user's mistake.
            Some((toml, place)) => Manifest::parse(&toml, &place).map_err(Error::device),
            None => Err(Error::input(
                "--manifest",
                "no manifest, and the device does not provide one",
                "the manifest of the selected sequence",
            )),
        }
    }

    fn calibration(&mut self) -> Result<Option<Rig>> {
        let calibration = self.control.calibration()?;
        calibration
            .map(|(toml, place)| Rig::from_toml(&toml, &place).map_err(Error::device))
            .transpose()
    }
}

/// Rejects a calibration whose image size differs from that of the device's own calibration.
fn check_size(place: &str, given: &Rig, own: &Rig) -> Result<()> {
    let size = |rig: &Rig| {
        let lens = &rig.camera.lens;
        format!("{} x {}", lens.width_px, lens.height_px)
    };
    if size(given) == size(own) {
        return Ok(());
    }
    Err(Error::input(
        format!("{place}: camera.lens.width_px/height_px"),
        size(given),
        format!("the size of the device's frames, {}", size(own)),
    ))
}
