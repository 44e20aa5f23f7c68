//! The service socket: ground truth, and control of what happens around the device. The wire format
//! is in [`phasmid_protocol::service`].
//!
//! Only its owner may use it: its mode is `0600` in a directory of mode `0700`, and a client of
//! another user, including root, is refused with a message.

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

/// Maximum number of refused clients that are being sent the reason; further connections are closed
/// without one.
const MAX_TURNED_AWAY: usize = 16;

/// A reply and its binary data.
pub(super) type Answer = (Reply, Vec<u8>);
/// A request and the channel for its answer.
pub(super) type Call = (Request, oneshot::Sender<Answer>);

/// The listening socket.
pub(super) struct ServiceSocket {
    listener: UnixListener,
    /// User id of the owner.
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

    /// Returns the number of connected clients.
    pub(super) fn clients(&self) -> usize {
        self.places.taken()
    }

    /// Returns the next request of any client.
    pub(super) async fn next(&mut self) -> Call {
        loop {
            tokio::select! {
                accepted = self.listener.accept() => match accepted {
                    Ok((stream, _)) => self.take(stream),
                    // Out of descriptors, for example: waiting clients may be served later.
                    Err(_) => tokio::time::sleep(Duration::from_millis(100)).await,
                },
                // This end holds a sender, so the channel never closes.
                Some(call) = self.calls.recv() => return call,
            }
        }
    }

    /// Accepts a client, or refuses it with a reason.
    fn take(&self, stream: UnixStream) {
        let place = match foreign(&stream, self.owner) {
            Some(why) => Err(why),
            None => self.places.enter(),
        };
        match place {
            Ok(place) => {
                let caller = self.caller.clone();
                tokio::spawn(async move {
                    // A broken connection does not affect the device.
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

/// Returns why a client is not the owner, by the credentials that the system attached when it
/// connected (`SO_PEERCRED`, unix(7)).
fn foreign(stream: &UnixStream, owner: u32) -> Option<String> {
    let whose = match stream.peer_cred() {
        Ok(cred) if cred.uid() == owner => return None,
        Ok(cred) => format!("user {}", cred.uid()),
        Err(_) => "an unknown user".to_owned(),
    };
    Some(format!(
        "service channel: {whose}; expected its owner, user {owner}"
    ))
}
