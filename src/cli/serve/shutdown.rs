//! What ends a device: a signal, or the end of whoever started it.

use phasmid_core::error::{Error, Result};
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::oneshot;

/// The reasons to end, watched from the moment this is made.
pub(in crate::cli) struct Shutdown {
    interrupt: Signal,
    terminate: Signal,
    /// A terminal that is closed.
    hang_up: Signal,
    parent: Option<oneshot::Receiver<()>>,
}

impl Shutdown {
    /// Watches, in a tokio runtime; `while_stdin` is `--while-stdin`.
    ///
    /// # Errors
    /// What the system refuses.
    pub(in crate::cli) fn watch(while_stdin: bool) -> Result<Self> {
        let signal = |kind| signal(kind).map_err(|e| Error::io("signals", e));
        Ok(Self {
            interrupt: signal(SignalKind::interrupt())?,
            terminate: signal(SignalKind::terminate())?,
            hang_up: signal(SignalKind::hangup())?,
            parent: while_stdin.then(end_of_input),
        })
    }

    /// Waits for the first of them.
    pub(in crate::cli) async fn wait(&mut self) {
        tokio::select! {
            _ = self.interrupt.recv() => {}
            _ = self.terminate.recv() => {}
            _ = self.hang_up.recv() => {}
            () = gone(self.parent.as_mut()) => {}
        }
    }
}

/// Tells when standard input has ended: whoever held its other end is gone, even by KILL.
fn end_of_input() -> oneshot::Receiver<()> {
    let (ended, wait) = oneshot::channel();
    std::thread::spawn(move || {
        // What is written there is nobody's concern; an error is an end too.
        let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
        let _ = ended.send(());
    });
    wait
}

async fn gone(parent: Option<&mut oneshot::Receiver<()>>) {
    match parent {
        // The thread sends, or dies: both are the end.
        Some(wait) => {
            let _ = wait.await;
        }
        None => std::future::pending().await,
    }
}
