//! The service socket: ground truth and what happens to the device from outside. The wire format is in
//! [`phasmid_protocol::service`].
//!
//! It is its owner's alone: its mode is `0600` in a directory of `0700`, and whoever comes as another
//! user all the same, root included, is told so and turned away.

mod places;
mod talk;
#[cfg(test)]
mod tests;

use phasmid_core::error::{Error, Result};
use phasmid_protocol::service::{Reply, Request};
use places::Places;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{UnixListener, UnixStream};
use tokio::sync::{Semaphore, mpsc, oneshot};

/// Clients that are being told why they cannot stay; more find their connection closed.
const MAX_TURNED_AWAY: usize = 16;

/// A reply and the bytes that follow it.
pub(super) type Answer = (Reply, Vec<u8>);
/// A request and where its answer goes.
pub(super) type Call = (Request, oneshot::Sender<Answer>);

/// The listener.
pub(super) struct ServiceSocket {
    listener: UnixListener,
    /// The user whose it is.
    owner: u32,
    calls: mpsc::Receiver<Call>,
    caller: mpsc::Sender<Call>,
    places: Places,
    turned_away: Arc<Semaphore>,
}

impl ServiceSocket {
    pub(super) fn open(path: &Path) -> Result<Self> {
        let io = |e| Error::io(path, e);
        let listener = UnixListener::bind(path).map_err(io)?;
        fs::set_permissions(path, fs::Permissions::from_mode(0o600)).map_err(io)?;
        let (caller, calls) = mpsc::channel(1);
        Ok(Self {
            listener,
            owner: rustix::process::geteuid().as_raw(),
            calls,
            caller,
            places: Places::new(places::IDLE),
            turned_away: Arc::new(Semaphore::new(MAX_TURNED_AWAY)),
        })
    }

    /// Connections.
    pub(super) fn clients(&self) -> usize {
        self.places.taken()
    }

    /// The next request of any client.
    pub(super) async fn next(&mut self) -> Call {
        loop {
            tokio::select! {
                accepted = self.listener.accept() => match accepted {
                    Ok((stream, _)) => self.take(stream),
                    // Out of descriptors, say: whoever is waiting may be served later.
                    Err(_) => tokio::time::sleep(Duration::from_millis(100)).await,
                },
                // This end holds a sender: the channel never closes.
                Some(call) = self.calls.recv() => return call,
            }
        }
    }

    /// Gives a client its place, or the reason why there is none.
    fn take(&self, stream: UnixStream) {
        let place = match foreign(&stream, self.owner) {
            Some(why) => Err(why),
            None => self.places.enter(),
        };
        match place {
            Ok(place) => {
                let caller = self.caller.clone();
                tokio::spawn(async move {
                    // A client that breaks off is no concern of the device.
                    let _ = talk::converse(stream, caller, place).await;
                });
            }
            Err(why) => {
                if let Ok(turn) = self.turned_away.clone().try_acquire_owned() {
                    tokio::spawn(async move {
                        let _ = talk::turn_away(stream, &why).await;
                        drop(turn);
                    });
                }
            }
        }
    }
}

/// Why a client is not the owner: by the credentials that the system attached when it connected
/// (`SO_PEERCRED`, unix(7)).
fn foreign(stream: &UnixStream, owner: u32) -> Option<String> {
    let whose = match stream.peer_cred() {
        Ok(cred) if cred.uid() == owner => return None,
        Ok(cred) => format!("user {}", cred.uid()),
        Err(_) => "a user that the system does not tell".to_owned(),
    };
    Some(format!(
        "service channel: {whose}; allowed: its owner, user {owner}"
    ))
}
