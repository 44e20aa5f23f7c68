//! Reasons to end a device: a signal, or the end of the program that started it.

use crate::cli::interrupt::Signals;
use phasmid_core::error::{Error, Result};
use std::time::Duration;
use tokio::sync::oneshot;

/// Watches for reasons to end the program, from the creation of this value on.
pub(crate) struct Shutdown {
    signals: Signals,
    parent: Option<oneshot::Receiver<()>>,
}

impl Shutdown {
    /// Starts to watch, inside a tokio runtime. `while_stdin` is the option `--while-stdin`.
    ///
    /// # Errors
    /// Returns an error if a signal handler cannot be installed or a thread cannot be started.
    pub(crate) fn watch(while_stdin: bool) -> Result<Self> {
        Ok(Self {
            signals: Signals::install().map_err(|e| Error::io("signals", e))?,
            parent: while_stdin
                .then(end_of_input)
                .transpose()
                .map_err(|e| Error::io("a thread for the end of standard input", e))?,
        })
    }

    /// Returns whether a reason to end has occurred.
    pub(super) async fn has_come(&mut self) -> bool {
        // The event loop checks for signals only while a task waits, so wait briefly.
        let wait = Duration::from_millis(1);
        tokio::time::timeout(wait, self.wait()).await.is_ok()
    }

    /// Waits for the first reason to end.
    pub(crate) async fn wait(&mut self) {
        tokio::select! {
            () = self.signals.next() => {}
            () = gone(self.parent.as_mut()) => {}
        }
    }
}

/// Returns a channel that reports when standard input closes, which happens when the process at its
/// other end ends or is killed.
fn end_of_input() -> std::io::Result<oneshot::Receiver<()>> {
    let (ended, wait) = oneshot::channel();
    std::thread::Builder::new().spawn(move || {
        // Discard the content. A read error also counts as the end of standard input.
        let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
        let _ = ended.send(());
    })?;
    Ok(wait)
}

async fn gone(parent: Option<&mut oneshot::Receiver<()>>) {
    match parent {
        // The thread sends a message or ends without sending. Both count as the end of standard
        // input.
        Some(wait) => {
            let _ = wait.await;
        }
        None => std::future::pending().await,
    }
}
