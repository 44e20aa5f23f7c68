//! A scanner at its addresses, emulated or physical.

use phasmid_core::error::{Error, Result};
use phasmid_decode::Capture;
use phasmid_geometry::Rig;
use phasmid_host::usb::{UsbAddress, UsbCamera, UsbDevice, UsbPort};
use phasmid_host::{
    Camera, CameraDriver, CommandPort, Flow, Intake, Progress, RecordedCamera, RecordedPort,
    SerialPort, Tape, open_camera,
};
use phasmid_pattern::Manifest;
use phasmid_protocol::dialect::Dialect;
use phasmid_protocol::record::Observer;
#[cfg(unix)]
use phasmid_protocol::service::call;
use phasmid_protocol::service::{ClockPace, Item, Maps, Reply, Request};
use phasmid_protocol::{Endpoints, endpoints};
use phasmid_render::truth::Truth;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// Options of a [`Scanner`]: how it is connected, and how it scans.
#[derive(Debug, Clone)]
pub struct ScanOptions {
    /// Sequence to select; `None` keeps the sequence that is selected in the device.
    pub sequence: Option<String>,
    /// Manifest of the sequence, for a device that does not report it.
    pub manifest: Option<Manifest>,
    /// Dialect of the control port: a built-in name or the path of a TOML file. `None` selects the
    /// dialect in the `device.json` beside the port if there is one, else SCPI.
    pub dialect: Option<String>,
    /// Calibration to use instead of the device's own. If this calibration has no noise model, the
    /// device's noise model is used.
    pub calibration: Option<Rig>,
    /// How a camera at `/dev/videoN` is read.
    pub driver: CameraDriver,
    /// Maximum time to wait for a reply, or for a device to open.
    pub reply_timeout: Duration,
    /// Maximum time to wait for a frame, counted from the trigger or from the previous frame.
    pub frame_timeout: Duration,
}

impl Default for ScanOptions {
    /// Returns options for the selected sequence of a device that reports its calibration, with
    /// time-outs of 10 s.
    fn default() -> Self {
        Self {
            sequence: None,
            manifest: None,
            dialect: None,
            calibration: None,
            driver: CameraDriver::Auto,
            reply_timeout: Duration::from_secs(10),
            frame_timeout: Duration::from_secs(10),
        }
    }
}

type AnyScanner = phasmid_host::Scanner<Box<dyn Camera + Send>, Box<dyn CommandPort + Send>>;

/// A scanner, emulated or physical, with an open camera and control port.
///
/// ```
/// # fn main() -> Result<(), phasmid::Error> {
/// use phasmid::{Device, ScanOptions, Scanner, ServeOptions};
/// let device = Device::builder().profile("webcam-grey").scene("plane").build()?;
/// let serving = device.serve(&ServeOptions::default())?;
/// let at = serving.endpoints();
///
/// let mut scanner = Scanner::connect(&at.camera, &at.control, ScanOptions::default())?;
/// let capture = scanner.scan()?;
/// assert_eq!(capture.images.len(), 13);
/// scanner.finish()?;
/// # Ok(())
/// # }
/// ```
pub struct Scanner {
    scanner: AnyScanner,
    options: phasmid_host::ScanOptions,
    /// Path of the control port, for messages and to find `device.json`.
    control: PathBuf,
}

impl fmt::Debug for Scanner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Scanner")
            .field("control", &self.control)
            .finish_non_exhaustive()
    }
}

impl Scanner {
    /// Connects to the camera and the control port of a device. `camera` is `/dev/videoN`,
    /// `socket:PATH` or `tcp:HOST:PORT`; `control` is the path of a serial port. If `camera` is
    /// `usb:HOST:PORT/BUSID`, the USB device also provides the control port, and `control` is used
    /// only to find the device's `device.json`, in the same folder.
    ///
    /// A free-running camera is stopped; [`Self::finish`] lets it run again.
    ///
    /// # Errors
    /// Returns an error if an address is invalid, or if the device does not answer.
    pub fn connect(camera: &str, control: impl AsRef<Path>, options: ScanOptions) -> Result<Self> {
        Self::recorded(camera, control, options, None)
    }

    /// Connects to the device served from a run directory, as its `device.json` says.
    ///
    /// # Errors
    /// Returns an error if the directory has no `device.json`, or an error of [`Self::connect`].
    pub fn of_run_dir(run_dir: impl AsRef<Path>, options: ScanOptions) -> Result<Self> {
        let at = endpoints_in(run_dir.as_ref())?;
        Self::connect(&at.camera, &at.control, options)
    }

    /// Connects like [`Self::connect`], and shows the traffic to an observer.
    ///
    /// # Errors
    /// Same as [`Self::connect`].
    pub fn observed(
        camera: &str,
        control: impl AsRef<Path>,
        options: ScanOptions,
        observer: Observer,
    ) -> Result<Self> {
        Self::recorded(camera, control, options, Some(Tape::shown(observer)))
    }

    /// Connects like [`Self::connect`], and records the traffic on a tape if there is one.
    pub(crate) fn recorded(
        camera: &str,
        control: impl AsRef<Path>,
        options: ScanOptions,
        tape: Option<Tape>,
    ) -> Result<Self> {
        let control = control.as_ref();
        let place = control.display().to_string();
        let dialect = dialect_of(options.dialect.as_deref(), control)?;
        let timeout = options.reply_timeout;
        let record = |camera: Box<dyn Camera + Send>| -> Box<dyn Camera + Send> {
            Box::new(RecordedCamera::new(camera, tape.clone()))
        };
        let scanner = if camera.starts_with("usb:") {
            let address = UsbAddress::parse(camera, camera)?;
            let device = Arc::new(UsbDevice::open(&address, timeout)?);
            let port: Box<dyn CommandPort + Send> =
                Box::new(RecordedPort::new(UsbPort::open(&device)?, tape.clone()));
            AnyScanner::with_dialect(port, dialect, timeout, || {
                Ok(record(Box::new(Intake::new(UsbCamera::open(
                    &device, None,
                )?))))
            })
        } else {
            let port: Box<dyn CommandPort + Send> =
                Box::new(RecordedPort::new(SerialPort::open(&place)?, tape.clone()));
            AnyScanner::with_dialect(port, dialect, timeout, || {
                open_camera(camera, options.driver, timeout).map(record)
            })
        };
        let mut scanner = scanner.map_err(|e| name_stepped_clock(e, control))?;
        if let Some(rig) = options.calibration {
            scanner = scanner.with_calibration("calibration", rig);
        }
        Ok(Self {
            scanner,
            options: phasmid_host::ScanOptions {
                sequence: options.sequence,
                manifest: options.manifest,
                frame_timeout: options.frame_timeout,
            },
            control: control.to_owned(),
        })
    }

    /// Uses a calibration instead of the device's own, as [`ScanOptions::calibration`] does; `place`
    /// names it in messages.
    #[must_use]
    pub(crate) fn with_calibration(self, place: &str, rig: Rig) -> Self {
        Self {
            scanner: self.scanner.with_calibration(place, rig),
            ..self
        }
    }

    /// Makes scans return captures without checking that the frames follow the sequence, for a caller
    /// that checks them while the next scan is running
    /// ([`check_sequence`](crate::decode::check_sequence)).
    #[must_use]
    pub fn without_checks(self) -> Self {
        Self {
            scanner: self.scanner.without_checks(),
            ..self
        }
    }

    /// Returns whether the camera's frames identify themselves.
    pub fn identifies(&self) -> bool {
        self.scanner.identifies()
    }

    /// Returns the name of the sequence that is selected in the device, if the device reports it.
    ///
    /// # Errors
    /// Returns an error if the port fails.
    pub fn selected(&mut self) -> Result<Option<String>> {
        self.scanner.selected()
    }

    /// Selects a sequence in the device now, without a scan.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    pub fn restore(&mut self, sequence: &str) -> Result<()> {
        self.scanner.select(sequence)
    }

    /// Selects the sequence of the following scans.
    pub fn select(&mut self, sequence: impl Into<String>) {
        self.options.sequence = Some(sequence.into());
    }

    /// Scans once. A run with a missing, repeated, foreign or damaged frame is repeated once.
    ///
    /// # Errors
    /// Returns an error if the device refuses, does not answer, sends invalid data, or keeps failing.
    pub fn scan(&mut self) -> Result<Capture> {
        self.scan_with(|_| ())
    }

    /// Scans once and reports the progress. `progress` may return `ControlFlow::Break(())` to end the
    /// scan; it is called at least ten times a second while a frame is awaited.
    ///
    /// ```
    /// # fn main() -> Result<(), phasmid::Error> {
    /// use phasmid::{Device, ScanOptions, Scanner, ServeOptions};
    /// use phasmid::host::Progress;
    /// use std::ops::ControlFlow;
    /// # let device = Device::builder().profile("webcam-grey").scene("plane").build()?;
    /// # let serving = device.serve(&ServeOptions::default())?;
    /// # let at = serving.endpoints();
    /// let mut scanner = Scanner::connect(&at.camera, &at.control, ScanOptions::default())?;
    /// let ended = scanner.scan_with(|progress| match progress {
    ///     Progress::Frame { done: 3, .. } => ControlFlow::Break(()),
    ///     _ => ControlFlow::Continue(()),
    /// });
    /// assert!(matches!(ended, Err(phasmid::Error::Interrupted)));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// Returns [`Error::Interrupted`] if `progress` ended the scan, and the errors of [`Self::scan`].
    pub fn scan_with<F: Flow>(
        &mut self,
        mut progress: impl FnMut(Progress<'_>) -> F,
    ) -> Result<Capture> {
        let captured = self.scanner.scan(&self.options, &mut progress);
        captured.map_err(|e| name_stepped_clock(e, &self.control))
    }

    /// Returns the truth of the selected sequence for the present state of the scene, so call this right
    /// after a scan. The device must be emulated: the `device.json` beside its control port names its
    /// service channel.
    ///
    /// # Errors
    /// Returns an error if the device has no service channel, which only emulated devices have.
    pub fn truth(&mut self) -> Result<Truth> {
        let maps = truth_maps(&service_of(&self.control)?)?;
        Truth::from_maps(maps)
    }

    /// Closes camera and port. A camera that was free-running when it was opened resumes.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    pub fn finish(self) -> Result<()> {
        self.scanner.finish()
    }
}

/// Returns the endpoints of the device that is served from a run directory.
///
/// # Errors
/// Returns an error if the directory has no `device.json`, or if the device has ended, because the
/// name of the device's port may then belong to another terminal.
pub(crate) fn endpoints_in(run_dir: &Path) -> Result<Endpoints> {
    let place = run_dir.display();
    let expected = "the run directory of a device that is being served";
    if !run_dir.join(endpoints::FILE_NAME).is_file() {
        let inside = std::fs::read_dir(run_dir).into_iter().flatten().flatten();
        let devices = inside.filter(|e| e.path().join(endpoints::FILE_NAME).is_file());
        let mut names: Vec<_> = devices.map(|e| e.path().display().to_string()).collect();
        names.sort();
        let expected = match names.is_empty() {
            true => expected.to_owned(),
            false => format!("one of {}", names.join(", ")),
        };
        let found = format!("no {} in it", endpoints::FILE_NAME);
        return Err(Error::input(place, found, expected));
    }
    let found = Endpoints::read(run_dir)?;
    if !is_served(run_dir) {
        let found = format!("its device (process {}) no longer runs", found.pid);
        return Err(Error::input(place, found, expected));
    }
    Ok(found)
}

/// Returns whether a device holds the lock of its run directory.
#[cfg(unix)]
fn is_served(run_dir: &Path) -> bool {
    use rustix::fs::{FlockOperation, flock};
    std::fs::File::open(run_dir)
        .is_ok_and(|dir| flock(&dir, FlockOperation::NonBlockingLockShared).is_err())
}

#[cfg(not(unix))]
fn is_served(_: &Path) -> bool {
    true
}

/// Maximum time for an answer on the service channel; the device first finishes frames in flight.
#[cfg(unix)]
const ANSWER: Duration = Duration::from_secs(60);

/// Returns the service channel of the device at a control port.
///
/// # Errors
/// Returns an error if no `device.json` beside the port names one.
pub(crate) fn service_of(control: &Path) -> Result<PathBuf> {
    let service = device_json(control).map(|(found, _)| found.service);
    let service = service.filter(|path| !path.as_os_str().is_empty());
    service.ok_or_else(|| {
        Error::input(
            format!("truth of the device at {}", control.display()),
            format!(
                "no {} beside it that names a service channel",
                endpoints::FILE_NAME
            ),
            "an emulated device: a physical one has no truth",
        )
    })
}

/// Asks a device for the truth of its last scan.
///
/// # Errors
/// Returns an error if the service channel cannot be opened or the device refuses.
pub(crate) fn truth_maps(service: &Path) -> Result<Maps> {
    Ok(ask_service(service, &Request::Get(Item::Truth))?.1)
}

/// Asks a device on its service channel.
///
/// # Errors
/// Returns an error if the service channel cannot be opened or the device refuses.
#[cfg(unix)]
pub(crate) fn ask_service(service: &Path, request: &Request) -> Result<(Reply, Maps)> {
    call(&mut connected(service)?, request)
}

#[cfg(not(unix))]
pub(crate) fn ask_service(service: &Path, _: &Request) -> Result<(Reply, Maps)> {
    Err(Error::device(format!(
        "{}: this system has no Unix sockets",
        service.display()
    )))
}

/// Connects to a device's service channel.
///
/// # Errors
/// Returns an error if the socket cannot be opened.
#[cfg(unix)]
pub(crate) fn connected(service: &Path) -> Result<std::os::unix::net::UnixStream> {
    let io = |e| Error::io(service, e);
    let stream = std::os::unix::net::UnixStream::connect(service).map_err(io)?;
    stream.set_read_timeout(Some(ANSWER)).map_err(io)?;
    stream.set_write_timeout(Some(ANSWER)).map_err(io)?;
    Ok(stream)
}

/// Returns the dialect of a control port: as requested, else as the `device.json` beside the port says;
/// `None` if neither exists.
pub(crate) fn dialect_of(asked: Option<&str>, control: &Path) -> Result<Option<Dialect>> {
    if let Some(asked) = asked {
        return Dialect::load(asked).map(Some);
    }
    let Some((found, place)) = device_json(control) else {
        return Ok(None);
    };
    let dialect = found.dialect.as_deref().map(Dialect::load).transpose();
    dialect.map_err(|e| e.at(place.display()))
}

/// Returns the `device.json` beside a control port and its path; `None` if there is none, or if it
/// describes another port.
fn device_json(control: &Path) -> Option<(Endpoints, PathBuf)> {
    let folder = control.parent().unwrap_or(Path::new(""));
    let found = Endpoints::read(folder).ok()?;
    let own = found.control.file_name() == control.file_name();
    own.then(|| (found, folder.join(endpoints::FILE_NAME)))
}

/// Adds a remark to an error of a device with a stepped clock, if the `device.json` beside the
/// control port states that clock: a wait for such a device may last until a client advances the
/// clock.
fn name_stepped_clock(error: Error, control: &Path) -> Error {
    let (Error::Device(message), Some((found, place))) = (&error, device_json(control)) else {
        return error;
    };
    if found.clock != Some(ClockPace::Stepped) {
        return error;
    }
    Error::device(format!(
        "{message}; the clock of this device is stepped ({}): it stands still until a client \
         advances it by {{\"clock\":{{\"step_ns\":N}}}} on {}",
        place.display(),
        found.service.display()
    ))
}
