//! The service socket: gives ground truth and control of the device's surroundings. The wire format
//! is in [`phasmid_protocol::service`].
//!
//! Only the owner of the socket may use it: the socket's mode is `0600` in a directory of mode
//! `0700`, and a client of another user, including root, is refused with a message.

mod places;
#[cfg(test)]
mod tests;

use phasmid_core::error::{Error, Result};
use phasmid_protocol::service::{MAX_LINE, Reply, Request};
use places::{Place, Places};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::fs;
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::net::unix::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{UnixListener, UnixStream};
use tokio::sync::{Semaphore, mpsc, oneshot};

/// Maximum number of refused clients that are being sent the reason; further refused connections are
/// closed without a reason.
const MAX_TURNED_AWAY: usize = 16;

/// Maximum time in which a client must read an answer.
const MAX_WRITE: Duration = Duration::from_secs(30);
/// Maximum time to read from a refused client. It may have written before it reads, and closing the
/// connection with unread input would reset it and hide the reason from the client.
const LAST_WORDS: Duration = Duration::from_secs(1);
/// Interval at which to check whether a client waiting for its answer is still connected.
const LOOK_AGAIN: Duration = Duration::from_millis(100);

/// A reply and the binary data that follows it.
pub(super) type Answer = (Reply, Vec<u8>);
/// A request and the channel for its answer.
pub(super) type Call = (Request, oneshot::Sender<Answer>);

/// The listening socket and its clients.
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
                    // The error may be temporary, such as too many open descriptors; waiting clients
                    // are then served later.
                    Err(_) => tokio::time::sleep(Duration::from_millis(100)).await,
                },
                // `self` holds a sender, so the channel never closes.
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
                    let _ = converse(stream, caller, place).await;
                });
            }
            Err(why) => {
                if let Ok(turn) = self.turned_away.clone().try_acquire_owned() {
                    tokio::spawn(async move {
                        let _ = turn_away(stream, &why).await;
                        drop(turn);
                    });
                }
            }
        }
    }
}

/// Returns why a client is refused, or `None` for the owner. The client's user is known from the
/// credentials that the system recorded when the client connected (`SO_PEERCRED`, unix(7)).
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

/// A piece of input from a client.
enum Line {
    /// A line with its newline.
    Whole(Vec<u8>),
    /// The line exceeds the maximum length; its remainder has not been read yet.
    TooLong,
    /// The client's last bytes, without a newline.
    Cut,
    /// End of input.
    End,
}

/// Answers a client until the client disconnects or must make room for another one.
async fn converse(stream: UnixStream, caller: mpsc::Sender<Call>, place: Place) -> io::Result<()> {
    let (reader, mut writer) = stream.into_split();
    let mut reader = BufReader::new(reader);
    loop {
        place.set_idle(true);
        let line = tokio::select! {
            line = next_line(&mut reader) => line?,
            () = place.taken_back() => {
                let why = "service channel: closed to make room for another client, as this one \
                           has been idle the longest";
                return dismiss(reader, writer, why).await;
            }
        };
        place.set_idle(false);
        let not_a_line = || {
            let what = format!("a request is a line of JSON of up to {MAX_LINE} bytes");
            (Reply::refusal(what), Vec::new())
        };
        let (reply, payload) = match &line {
            Line::End => return Ok(()),
            Line::TooLong | Line::Cut => not_a_line(),
            Line::Whole(line) => match Request::parse(line) {
                Err(why) => (Reply::refusal(why), Vec::new()),
                Ok(request) => match ask(&caller, request, &writer).await {
                    Some(answer) => answer,
                    None => return Ok(()),
                },
            },
        };
        let write = async {
            writer.write_all(reply.to_line().as_bytes()).await?;
            writer.write_all(&payload).await
        };
        tokio::time::timeout(MAX_WRITE, write).await??;
        if matches!(line, Line::TooLong) {
            place.set_idle(true);
            tokio::select! {
                skipped = skip_line(&mut reader) => skipped?,
                () = place.taken_back() => return Ok(()),
            }
        }
    }
}

/// Sends a client the reason for its refusal.
async fn turn_away(stream: UnixStream, why: &str) -> io::Result<()> {
    let (reader, writer) = stream.into_split();
    dismiss(BufReader::new(reader), writer, why).await
}

/// Sends a last message to a client, then reads and discards the client's remaining input so that
/// closing the connection does not destroy the message.
async fn dismiss(
    mut reader: BufReader<OwnedReadHalf>,
    mut writer: OwnedWriteHalf,
    why: &str,
) -> io::Result<()> {
    let last = async {
        let refusal = Reply::refusal(why).to_line();
        writer.write_all(refusal.as_bytes()).await?;
        writer.shutdown().await?;
        tokio::io::copy(&mut reader, &mut tokio::io::sink()).await
    };
    tokio::time::timeout(LAST_WORDS, last).await?.map(drop)
}

async fn next_line(reader: &mut BufReader<OwnedReadHalf>) -> io::Result<Line> {
    let mut line = Vec::new();
    let mut most = reader.take(MAX_LINE as u64);
    let read = most.read_until(b'\n', &mut line).await?;
    Ok(match line.last() {
        _ if read == 0 => Line::End,
        Some(b'\n') => Line::Whole(line),
        _ if read == MAX_LINE => Line::TooLong,
        _ => Line::Cut,
    })
}

/// Reads and discards the rest of a line.
async fn skip_line(reader: &mut BufReader<OwnedReadHalf>) -> io::Result<()> {
    loop {
        let bytes = reader.fill_buf().await?;
        if bytes.is_empty() {
            return Ok(());
        }
        let end = bytes.iter().position(|&byte| byte == b'\n');
        let read = end.map_or(bytes.len(), |at| at + 1);
        reader.consume(read);
        if end.is_some() {
            return Ok(());
        }
    }
}

/// Returns the device's answer, or `None` if the client has disconnected.
async fn ask(
    caller: &mpsc::Sender<Call>,
    request: Request,
    client: &OwnedWriteHalf,
) -> Option<Answer> {
    let (reply, mut answer) = oneshot::channel();
    let gone = || (Reply::refusal("the device is shutting down"), Vec::new());
    if caller.send((request, reply)).await.is_err() {
        return Some(gone());
    }
    loop {
        tokio::select! {
            answer = &mut answer => return Some(answer.unwrap_or_else(|_| gone())),
            () = tokio::time::sleep(LOOK_AGAIN) => if has_left(client.as_ref()) {
                return None;
            }
        }
    }
}

/// Returns whether a client has closed its connection; a client that only shut down its sending
/// side still listens.
fn has_left(stream: &UnixStream) -> bool {
    let mut look = [PollFd::new(stream, PollFlags::empty())];
    let polled = poll(&mut look, Some(&Timespec::default()));
    polled.is_ok()
        && look[0]
            .revents()
            .intersects(PollFlags::HUP | PollFlags::ERR)
}
