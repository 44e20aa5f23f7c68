//! Ctrl-C and TERM during a capture: the camera returns an error instead of a frame, so the scan ends as
//! after any other failure and restores the device. A second signal exits at once.

use phasmid_core::error::{Error, Result};
use phasmid_host::Camera;
use phasmid_protocol::Frame;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Exit status of a program that SIGINT has ended, as in shells: 128 + 2.
const INTERRUPTED: i32 = 130;
/// Maximum delay from the signal to the end of the capture.
const SLICE: Duration = Duration::from_millis(100);

/// Whether one of the signals has come since the first capture began.
static ASKED: AtomicBool = AtomicBool::new(false);

/// Returns whether Ctrl-C or TERM has ended the captures.
pub(super) fn interrupted() -> bool {
    ASKED.load(Ordering::Relaxed)
}

/// A camera that returns an error after a signal to end the program.
pub(super) struct Interruptible<C> {
    camera: C,
    ended: bool,
}

impl<C> Interruptible<C> {
    /// Wraps a camera. From now on, the signals end captures instead of the program.
    pub(super) fn new(camera: C) -> Self {
        // If the thread cannot be started, the signals keep their default effect.
        let _ = std::thread::Builder::new()
            .name("signals".into())
            .spawn(move || {
                if wait().is_ok() {
                    ASKED.store(true, Ordering::Relaxed);
                    // The scan may still wait for a port that is gone; a second signal skips that wait.
                    if wait().is_ok() {
                        std::process::exit(INTERRUPTED);
                    }
                }
            });
        Self {
            camera,
            ended: false,
        }
    }
}

/// Waits for one of the signals.
fn wait() -> std::io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    runtime.block_on(async {
        #[cfg(unix)]
        {
            use tokio::signal::unix::{SignalKind, signal};
            let mut terminate = signal(SignalKind::terminate())?;
            tokio::select! {
                interrupted = tokio::signal::ctrl_c() => interrupted,
                _ = terminate.recv() => Ok(()),
            }
        }
        #[cfg(not(unix))]
        tokio::signal::ctrl_c().await
    })
}

impl<C> Interruptible<C> {
    /// Returns an error after one of the signals.
    fn look(&mut self) -> Result<()> {
        self.ended = interrupted();
        match self.ended {
            true => Err(Error::device("interrupted")),
            false => Ok(()),
        }
    }
}

impl<C: Camera> Camera for Interruptible<C> {
    fn info(&self) -> &str {
        self.camera.info()
    }

    fn next_frame(&mut self, timeout: Duration) -> Result<Option<Frame>> {
        let end = Instant::now() + timeout;
        loop {
            self.look()?;
            let left = end.saturating_duration_since(Instant::now());
            let frame = self.camera.next_frame(left.min(SLICE))?;
            if frame.is_some() || left <= SLICE {
                return Ok(frame);
            }
        }
    }

    fn has_skipped(&self) -> bool {
        !self.ended && self.camera.has_skipped()
    }

    fn identifies(&self) -> bool {
        self.camera.identifies()
    }
    fn has_gone(&self) -> bool {
        !self.ended && self.camera.has_gone()
    }

    fn reopen(&mut self, timeout: Duration) -> Result<()> {
        self.look()?;
        let reopened = self.camera.reopen(timeout);
        self.look()?;
        reopened
    }
}
