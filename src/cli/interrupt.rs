//! Ctrl-C and TERM during a capture: the scan ends as after any other failure and restores the device. A
//! second signal exits at once.

use phasmid_core::error::{Error, Result};
use std::ops::ControlFlow;
use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// Time between two looks at the signals.
const POLL: Duration = Duration::from_millis(50);
/// Exit status of a program that SIGINT has ended, as in shells: 128 + 2.
const INTERRUPTED: i32 = 130;

/// Whether one of the signals has come since the first capture began.
static ASKED: AtomicBool = AtomicBool::new(false);

/// Returns whether Ctrl-C or TERM has ended the captures.
pub(super) fn interrupted() -> bool {
    ASKED.load(Ordering::Relaxed)
}

/// Returns whether a capture goes on. From the first call on, the signals end captures instead of the
/// program.
pub(super) fn flow() -> ControlFlow<()> {
    static WATCH: Once = Once::new();
    WATCH.call_once(watch);
    match interrupted() {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    }
}

/// Lets the signals end what follows at the next [`check`] or [`flow`], instead of the program.
pub(super) fn watch_signals() {
    let _ = flow();
}

/// Returns an error if Ctrl-C or TERM has come.
///
/// # Errors
/// [`Error::Interrupted`].
pub(super) fn check() -> Result<()> {
    match interrupted() {
        true => Err(Error::Interrupted),
        false => Ok(()),
    }
}

/// Waits for a result that another thread computes, but no longer than until one of the signals.
///
/// # Errors
/// Returns the error of the work, or [`Error::Interrupted`].
pub(super) fn unless_interrupted<T: Send + 'static>(
    work: impl FnOnce() -> Result<T> + Send + 'static,
) -> Result<T> {
    let (done, waiting) = mpsc::channel();
    let thread = std::thread::Builder::new().spawn(move || {
        let _ = done.send(work());
    });
    thread.map_err(|e| Error::io("a thread that waits for an answer", e))?;
    loop {
        check()?;
        match waiting.recv_timeout(POLL) {
            Ok(result) => return result,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                return Err(Error::device(
                    "the thread that waits for an answer panicked",
                ));
            }
        }
    }
}

fn watch() {
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
