//! The service socket: ground truth and what happens to the device from outside. The wire format is in
//! [`crate::protocol::service`].
//!
//! It is its owner's alone: its mode is `0600` in a directory of `0700`, and whoever comes as another
//! user all the same, root included, is told so and turned away.

use crate::error::{Error, Result};
use crate::protocol::service::{MAX_LINE, Reply, Request};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::net::{UnixListener, UnixStream};
use tokio::sync::{Semaphore, mpsc, oneshot};

/// Clients at a time; more are turned away.
const MAX_CLIENTS: usize = 16;
/// How long a client may take to read an answer.
const MAX_WRITE: Duration = Duration::from_secs(30);

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
    places: Arc<Semaphore>,
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
            places: Arc::new(Semaphore::new(MAX_CLIENTS)),
        })
    }

    /// Connections.
    pub(super) fn clients(&self) -> usize {
        MAX_CLIENTS - self.places.available_permits()
    }

    /// The next request of any client.
    pub(super) async fn next(&mut self) -> Call {
        loop {
            tokio::select! {
                accepted = self.listener.accept() => match accepted {
                    Ok((stream, _)) => {
                        // A client above the limit finds its connection closed.
                        if let Ok(place) = self.places.clone().try_acquire_owned() {
                            let caller = self.caller.clone();
                            let owner = self.owner;
                            tokio::spawn(async move {
                                // A client that breaks off is no concern of the device.
                                let _ = match foreign(&stream, owner) {
                                    Some(why) => turn_away(stream, &why).await,
                                    None => converse(stream, caller).await,
                                };
                                drop(place);
                            });
                        }
                    }
                    // Out of descriptors, say: whoever is waiting may be served later.
                    Err(_) => tokio::time::sleep(Duration::from_millis(100)).await,
                },
                // This end holds a sender: the channel never closes.
                Some(call) = self.calls.recv() => return call,
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

async fn turn_away(mut stream: UnixStream, why: &str) -> std::io::Result<()> {
    let refusal = Reply::refusal(why).to_line();
    let write = stream.write_all(refusal.as_bytes());
    tokio::time::timeout(MAX_WRITE, write).await?
}

async fn converse(stream: UnixStream, caller: mpsc::Sender<Call>) -> std::io::Result<()> {
    let (reader, mut writer) = stream.into_split();
    let mut reader = BufReader::new(reader);
    loop {
        let mut line = Vec::new();
        let read = (&mut reader)
            .take(MAX_LINE as u64)
            .read_until(b'\n', &mut line)
            .await?;
        if read == 0 {
            return Ok(());
        }
        if line.last() != Some(&b'\n') {
            let refusal = Reply::refusal(format!(
                "a request is a line of JSON of up to {MAX_LINE} bytes"
            ));
            return writer.write_all(refusal.to_line().as_bytes()).await;
        }
        let (reply, payload) = match Request::parse(&line) {
            Err(why) => (Reply::refusal(why), Vec::new()),
            Ok(request) => ask(&caller, request).await,
        };
        let write = async {
            writer.write_all(reply.to_line().as_bytes()).await?;
            writer.write_all(&payload).await
        };
        tokio::time::timeout(MAX_WRITE, write).await??;
    }
}

async fn ask(caller: &mpsc::Sender<Call>, request: Request) -> Answer {
    let (reply, answer) = oneshot::channel();
    let gone = || (Reply::refusal("the device is going away"), Vec::new());
    if caller.send((request, reply)).await.is_err() {
        return gone();
    }
    answer.await.unwrap_or_else(|_| gone())
}
