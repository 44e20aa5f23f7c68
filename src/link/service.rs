//! The service socket, `0600`: ground truth and what happens to the device from outside. The wire
//! format is in [`crate::protocol::service`].

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
            calls,
            caller,
            places: Arc::new(Semaphore::new(MAX_CLIENTS)),
        })
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
                            tokio::spawn(async move {
                                // A client that breaks off is no concern of the device.
                                let _ = converse(stream, caller).await;
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
