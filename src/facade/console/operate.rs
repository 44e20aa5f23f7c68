//! A scanner that is operated from a console.

use super::calibrator::let_calibrate;
use super::follower::answer;
use super::{Follower, ScanViews};
use crate::facade::{ScanOptions, Scanner, dialect_of, service_of, watch_camera};
use phasmid_console::{Operator, Request, Run, Sequence, Source};
use phasmid_core::error::{Error, Result};
use phasmid_device::Firmware;
use phasmid_host::{CommandPort, Progress, RecordedPort, SerialPort, Tape};
use phasmid_protocol::printable;
use phasmid_protocol::record::Observer;
use serde_json::{Value, json};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Maximum number of bytes of a reply that are shown.
const MAX_REPLY: usize = 64 << 10;
/// A reply that does not end with a newline is complete once no byte has come for this time.
const QUIET: Duration = Duration::from_millis(300);
/// Time between two attempts to use the port.
const SOON: Duration = Duration::from_millis(10);
/// Maximum time to send a line, and maximum time from then until the reply to a query begins.
const REPLY: Duration = Duration::from_secs(3);

/// Shows a camera's live frames until `flow` returns `Break`. When viewers ask for it, scans, or
/// sends lines to the control port. Between scans the camera is left as it was found and the port
/// is closed, so that other programs can use it.
///
/// ```no_run
/// use phasmid::{Console, ConsoleOptions, ScanOptions};
/// use std::ops::ControlFlow;
///
/// let console = Console::start(&ConsoleOptions::default())?;
/// println!("open {}", console.url());
/// let source = console.source("bench");
/// phasmid::operate(&source, "/dev/video0", "/dev/ttyUSB0", &ScanOptions::default(), || {
///     ControlFlow::Continue(())
/// })?;
/// # Ok::<(), phasmid::Error>(())
/// ```
///
/// # Errors
/// Returns an error if the camera cannot be opened the first time. Later errors are shown to
/// viewers only.
pub fn operate(
    source: &Source,
    camera: &str,
    control: impl AsRef<Path>,
    options: &ScanOptions,
    mut flow: impl FnMut() -> ControlFlow<()>,
) -> Result<()> {
    let control = control.as_ref();
    let service = service_of(control).ok();
    let follower = match &service {
        Some(service) => {
            let follower = Follower::of_host(source.clone())?;
            follower.ask_at(service);
            Some(follower)
        }
        None => None,
    };
    let asked = Arc::new(Asked {
        control: control.to_owned(),
        scpi: dialect_of(options.dialect.as_deref(), control)?.is_none_or(|found| found.is_scpi()),
        service: service.clone(),
        observer: source.observer(),
        scanning: AtomicBool::new(false),
        port: Mutex::default(),
        next: Mutex::default(),
    });
    source.operate(asked.clone());
    let_calibrate(source);
    // Scans by other programs are shown too, if the service channel reports their sequence.
    let live = { follower.as_ref() }.map_or_else(|| source.observer(), Follower::observer);
    let (mut seen, mut failed) = (false, false);
    loop {
        // `flow` is not called before the camera has been opened once.
        if seen && flow().is_break() {
            return Ok(());
        }
        let Some((run, sequence)) = asked.next().take() else {
            let watched = watch_camera(camera, options.driver, &live, || {
                seen = true;
                if std::mem::take(&mut failed) {
                    source.say(None);
                }
                match asked.is_asked() {
                    true => ControlFlow::Break(()),
                    false => flow(),
                }
            });
            match watched {
                Ok(()) => {}
                Err(error) if !seen => return Err(error),
                Err(error) => {
                    source.say(Some(error.to_string()));
                    failed = true;
                    std::thread::sleep(QUIET);
                }
            }
            continue;
        };
        if run == Run::Stop {
            source.say(None);
            continue;
        }
        let options = ScanOptions {
            sequence: sequence.or_else(|| options.sequence.clone()),
            ..options.clone()
        };
        asked.scanning.store(true, Ordering::Relaxed);
        let port = asked.port();
        source.say(Some("connecting".into()));
        let scanned =
            Scanner::observed(camera, control, options, source.observer()).and_then(|scanner| {
                let again = || run == Run::Repeat && !asked.is_asked();
                scan(source, scanner, service.as_deref(), again, || {
                    match asked.is_stopped() {
                        true => ControlFlow::Break(()),
                        false => flow(),
                    }
                })
            });
        drop(port);
        asked.scanning.store(false, Ordering::Relaxed);
        source.say(match scanned {
            Ok(()) | Err(Error::Interrupted) => None,
            Err(error) => Some(error.to_string()),
        });
    }
}

/// Scans once, and repeats the scan while `again` returns `true`.
fn scan(
    source: &Source,
    mut scanner: Scanner,
    service: Option<&Path>,
    again: impl Fn() -> bool,
    mut flow: impl FnMut() -> ControlFlow<()>,
) -> Result<()> {
    let mut scans = || {
        loop {
            let capture = scanner.scan_with(|progress| {
                match progress {
                    Progress::Identified(_) => {}
                    Progress::Frame { done, of } => {
                        source.say(Some(format!("frame {done} of {of}")));
                    }
                    Progress::Retry(why) => source.say(Some(format!("scanning again: {why}"))),
                    Progress::Waiting => {}
                }
                flow()
            })?;
            let sequence = Sequence {
                name: scanner.selected()?,
                manifest: capture.manifest.clone(),
                calibration: capture.calibration,
            };
            let mut views = ScanViews::new(capture);
            if let Some(name) = &sequence.name {
                views = views.named(name);
            }
            source.show_sequence(Arc::new(sequence));
            if let Some(service) = service {
                views = views.with_service(service);
            }
            source.show(Arc::new(views));
            if !again() {
                return Ok(());
            }
        }
    };
    let scanned = scans();
    let finished = scanner.finish();
    scanned.and(finished)
}

/// The requests of viewers.
struct Asked {
    control: PathBuf,
    /// Whether the port speaks SCPI.
    scpi: bool,
    service: Option<PathBuf>,
    observer: Observer,
    /// Whether a scan is using the port.
    scanning: AtomicBool,
    /// Locked while the port is in use.
    port: Mutex<()>,
    /// The next scan to make: how to run, and the sequence.
    next: Mutex<Option<(Run, Option<String>)>>,
}

impl Asked {
    fn next(&self) -> MutexGuard<'_, Option<(Run, Option<String>)>> {
        self.next.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn port(&self) -> MutexGuard<'_, ()> {
        self.port.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn is_asked(&self) -> bool {
        self.next().is_some()
    }

    fn is_stopped(&self) -> bool {
        matches!(*self.next(), Some((Run::Stop, _)))
    }

    /// Returns the SCPI headers that an emulated device knows, as suggestions for lines to any device
    /// that speaks SCPI; empty for other dialects.
    fn lines(&self) -> Vec<&'static str> {
        match self.scpi {
            true => Firmware::headers().collect(),
            false => Vec::new(),
        }
    }

    /// Sends a line to the device and returns the reply.
    fn talk(&self, line: &str) -> Result<Value> {
        let _port = loop {
            if self.scanning.load(Ordering::Relaxed) {
                return Err(Error::device("a scan is using the port; stop it first"));
            }
            // Wait until another viewer's line is done.
            match self.port.try_lock() {
                Ok(port) => break port,
                Err(_) => std::thread::sleep(SOON),
            }
        };
        let tape = Some(Tape::shown(self.observer.clone()));
        let port = SerialPort::open(&self.control.display().to_string())?;
        let mut port = RecordedPort::new(port, tape);
        port.send(format!("{line}\n").as_bytes(), REPLY)?;
        let begun = Instant::now();
        let (mut reply, mut buffer) = (Vec::new(), [0; 4096]);
        // Only a query has an answer; after any other line wait briefly.
        let patience = if line.contains('?') { REPLY } else { QUIET };
        while reply.len() < MAX_REPLY && !reply.ends_with(b"\n") {
            let wait = if reply.is_empty() { patience } else { QUIET };
            match port.receive(&mut buffer, wait)? {
                0 => break,
                len => reply.extend_from_slice(&buffer[..len]),
            }
        }
        let text = String::from_utf8_lossy(&reply);
        let text = printable(text.trim_end_matches(['\r', '\n']));
        Ok(json!({ "reply": text, "took_s": begun.elapsed().as_secs_f64() }))
    }
}

impl Operator for Asked {
    fn answers(&self) -> &'static [&'static str] {
        match self.service {
            Some(_) => &["line", "scan", "service"],
            None => &["line", "scan"],
        }
    }

    fn answer(&self, request: &Request) -> Result<Value> {
        match (request, &self.service) {
            (Request::Scan { run, sequence }, _) => {
                *self.next() = Some((*run, sequence.clone()));
                Ok(Value::Null)
            }
            (Request::Line(line), _) => self.talk(line),
            (Request::Lines {}, _) => Ok(json!(self.lines())),
            (Request::Service(request), Some(service)) => answer(service, request),
            (Request::Service(_), None) => Err(Error::device(
                "this device has no service channel, as no physical one has",
            )),
            _ => Err(Error::device("this scanner does not take such requests")),
        }
    }
}
