//! Handles a client's requests one after the other, and ends connections with a message.

use super::places::Place;
use super::{Answer, Call};
use phasmid_protocol::service::{MAX_LINE, Reply, Request};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::io;
use std::time::Duration;
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::net::UnixStream;
use tokio::net::unix::{OwnedReadHalf, OwnedWriteHalf};
use tokio::sync::{mpsc, oneshot};

/// Maximum time a client may take to read an answer.
const MAX_WRITE: Duration = Duration::from_secs(30);
/// How long to read from a refused client: it may have written before it reads, and a reset
/// connection would hide the reason from it.
const LAST_WORDS: Duration = Duration::from_secs(1);
/// Interval at which to check whether a client waiting for its answer is still connected.
const LOOK_AGAIN: Duration = Duration::from_millis(100);

/// Input from a client.
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

/// Answers a client until it disconnects or has to make room.
pub(super) async fn converse(
    stream: UnixStream,
    caller: mpsc::Sender<Call>,
    place: Place,
) -> io::Result<()> {
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
pub(super) async fn turn_away(stream: UnixStream, why: &str) -> io::Result<()> {
    let (reader, writer) = stream.into_split();
    dismiss(BufReader::new(reader), writer, why).await
}

/// Sends the last message to a client and reads its remaining input, so that it can read the
/// message.
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
