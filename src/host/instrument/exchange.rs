//! A conversation with an instrument: starts it, sends queries, and matches answers to queries.
//! SCPI does not number messages, and a line may lose, delay, duplicate or corrupt data. Therefore
//! each query begins with `*ESE n;*ESE?;`, and its answer with `n;`. Any IEEE 488.2 instrument
//! stores the number n (11.5.1.3), which has no other effect over a serial line. An answer to
//! another query, or an answer without a query, has another number.

use crate::CommandPort;
use crate::time::Deadline;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::scpi::{self, BlockPrefix, MAX_BLOCK_BYTES, MAX_LINE_BYTES};
use std::time::{Duration, Instant};

/// Maximum number of times that a query is sent, as long as no answer comes. All attempts together
/// take at most the timeout.
const ATTEMPTS: u32 = 3;
/// Time to wait for a valid answer after an invalid line.
const GRACE: Duration = Duration::from_millis(250);

/// First value to which `*ESE` is set, and which is then queried, when a conversation starts. Any
/// IEEE 488.2 instrument answers `85;0`; a device of another kind does not. Each further attempt
/// uses the next number.
const FIRST_MARK: u8 = 85;
const LAST_MARK: u8 = 125;
/// Maximum duration of an attempt, which is also limited to a third of the timeout. If an earlier
/// client broke off a block, the device takes the first attempt as part of that block, so an
/// attempt lasts longer than the device waits for the rest of a block.
const ASK_AGAIN: Duration = Duration::from_millis(1500);
/// A device's answer to a query.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Answer {
    /// Empty: the device did not understand the query, or refuses it.
    Void,
    /// The text of the answer, without the newline.
    Said(Vec<u8>),
}

/// Classification of the bytes received so far.
#[derive(Debug, PartialEq, Eq)]
enum Come {
    /// An incomplete line.
    Part,
    /// A line that does not answer the query.
    Junk,
    /// A power-on message; an answer may follow it.
    Chatter,
    Answer(Answer),
}

/// The start of a reply.
#[derive(Debug, PartialEq, Eq)]
enum Head {
    /// Too few bytes to decide.
    Part,
    /// The number with which the reply begins, and the offset in bytes where that number ends.
    Tag(u8, usize),
    /// Anything else.
    Other,
}

/// A conversation with an instrument.
pub struct Instrument<P> {
    pub(super) port: P,
    pub(super) timeout: Duration,
    /// Received bytes that have not been processed yet.
    received: Vec<u8>,
    /// The number of the last query.
    tag: u8,
    /// The port has failed.
    gone: bool,
    /// The start of the last line that was not an answer.
    pub(super) junk: Vec<u8>,
    /// Messages that the device sends unprompted at power-on.
    chatter: Vec<Vec<u8>>,
}

impl<P: CommandPort> Instrument<P> {
    /// Starts a conversation: terminates an unfinished line, clears the status, and skips
    /// everything in transit until the answer to a query that nobody else sends. `timeout` bounds
    /// this wait and every later one.
    ///
    /// # Errors
    /// Returns an error if the port is gone, or if nothing on it answers as IEEE 488.2 requires.
    pub fn open(port: P, timeout: Duration) -> Result<Self> {
        Self::open_chatty(port, Vec::new(), timeout)
    }

    /// Starts a conversation as [`Self::open`] does, with a device that sends the messages in
    /// `chatter`, in any number and order, at power-on. Such a message is neither an answer nor a
    /// sign of a corrupted answer.
    ///
    /// # Errors
    /// Same as [`Self::open`].
    pub fn open_chatty(port: P, chatter: Vec<Vec<u8>>, timeout: Duration) -> Result<Self> {
        let mut instrument = Self::new(port, timeout);
        instrument.chatter = chatter;
        instrument.find("\n*CLS\n")?;
        Ok(instrument)
    }

    pub(super) fn new(port: P, timeout: Duration) -> Self {
        Self {
            port,
            timeout,
            received: Vec::new(),
            tag: 0,
            gone: false,
            junk: Vec::new(),
            chatter: Vec::new(),
        }
    }

    /// Restores contact with a device that was silent or gone: reopens the port if it cannot be
    /// written to, aborts any operation for which the device waits, and starts as [`Self::open`]
    /// does. The device's status is not cleared, because it may show what happened.
    ///
    /// # Errors
    /// Same as [`Self::open`], and an error if the port does not come back within the timeout.
    pub fn recover(&mut self) -> Result<()> {
        // Alone on its line, ABOR takes effect even if the device is waiting for a trigger.
        self.find("\nABOR\n")
    }

    /// Performs the greeting; if the port is gone, reopens it and tries once more.
    fn find(&mut self, first: &str) -> Result<()> {
        self.gone = false;
        match self.greet(first) {
            Err(_) if self.gone => {
                self.port.reopen(self.timeout)?;
                self.greet(first)
            }
            done => done,
        }
    }

    /// Repeats `first` and a query with a new mark until the latest query is answered.
    fn greet(&mut self, first: &str) -> Result<()> {
        self.received.clear();
        let mut left = self.timeout;
        let mut buffer = [0; 4096];
        let mut seen = Vec::new();
        for mark in FIRST_MARK..=LAST_MARK {
            let query = format!("*ESE {mark};*ESE?;*ESE 0;*ESE?");
            self.send(format!("{first}{query}").as_bytes())?;
            let answer = format!("{mark};0");
            let begin = Instant::now();
            let again = left.min(ASK_AGAIN).min(self.timeout / ATTEMPTS);
            let mut deadline = Deadline::new(again);
            loop {
                let len = self.receive(&mut deadline, &mut buffer)?;
                seen.extend_from_slice(&buffer[..len]);
                if seen.ends_with(b"\n") && seen.trim_ascii_end().ends_with(answer.as_bytes()) {
                    return Ok(());
                }
                // Only the last received bytes are compared with the expected answer, so drop earlier
                // bytes.
                if seen.len() > 2 * buffer.len() {
                    seen.drain(..seen.len() - buffer.len());
                }
                if len == 0 || begin.elapsed() > again {
                    break;
                }
            }
            left = left.saturating_sub(again);
            // Stop when 1 % of the timeout is left, because three thirds of it may add up to
            // slightly less than the whole.
            if left < self.timeout / 100 {
                break;
            }
        }
        let last = &seen[seen.len() - seen.len().min(40)..];
        Err(self.failure(format!(
            "no answer to *ESE? within {} s (last received: \"{}\"): is it a SCPI instrument? If \
             not, choose its language with --dialect",
            self.timeout.as_secs_f64(),
            last.escape_ascii()
        )))
    }

    /// Returns the port's path, for messages.
    pub fn info(&self) -> &str {
        self.port.info()
    }

    pub(super) fn failure(&self, what: impl std::fmt::Display) -> Error {
        Error::device(format!("{}: {what}", self.info()))
    }

    /// Sends a command once, without waiting for anything.
    ///
    /// # Errors
    /// Returns an error if the port is gone or accepts no data.
    pub fn tell(&mut self, order: &str) -> Result<()> {
        self.send(order.as_bytes())
    }

    pub(crate) fn send(&mut self, line: &[u8]) -> Result<()> {
        let mut line = line.to_vec();
        line.push(b'\n');
        let sent = self.port.send(&line, self.timeout);
        self.gone |= sent.is_err();
        sent
    }

    fn receive(&mut self, deadline: &mut Deadline, buffer: &mut [u8]) -> Result<usize> {
        let received = deadline.receive(&mut self.port, buffer);
        self.gone |= received.is_err();
        received
    }

    /// Sends a query, and repeats it while no answer with its number comes; returns `None` if no
    /// answer comes within the timeout. The device may therefore execute the query more than once.
    ///
    /// # Errors
    /// Returns an error if the port is gone, or if the device keeps sending without end.
    pub(super) fn exchange(&mut self, body: &[u8]) -> Result<Option<Answer>> {
        self.junk.clear();
        let mut asked = Vec::new();
        let mut buffer = [0; 16 << 10];
        let begin = Instant::now();
        for attempt in 0..ATTEMPTS {
            self.tag = self.tag.checked_add(1).unwrap_or(1);
            asked.push(self.tag);
            self.received.clear();
            // A leading newline ends the previous attempt, whose own newline may have been lost.
            let end = if attempt == 0 { "" } else { "\n" };
            let mut line = format!("{end}*ESE {tag};*ESE?;", tag = self.tag).into_bytes();
            line.extend_from_slice(body);
            self.send(&line)?;
            let part = self.timeout / ATTEMPTS;
            let mut deadline = Deadline::new(part);
            let mut bytes = 0;
            loop {
                match self.look(&asked)? {
                    Come::Answer(answer) => return Ok(Some(answer)),
                    Come::Junk => {
                        deadline.shorten(GRACE);
                        continue;
                    }
                    Come::Chatter => continue,
                    Come::Part => {}
                }
                // While a long answer arrives on a slow line, keep reading, for at most twice the
                // timeout. A complete answer has been returned above.
                if bytes > 0 && begin.elapsed() > 2 * self.timeout {
                    break;
                }
                let len = self.receive(&mut deadline, &mut buffer)?;
                bytes += len;
                if len == 0 || bytes > 2 * MAX_BLOCK_BYTES {
                    break;
                }
                self.received.extend_from_slice(&buffer[..len]);
                if matches!(head(&self.received), Head::Tag(tag, _) if asked.contains(&tag)) {
                    deadline = Deadline::new(part);
                }
            }
        }
        self.received.clear();
        Ok(None)
    }

    /// Classifies the start of the received bytes, and removes a line or message that is complete.
    fn look(&mut self, asked: &[u8]) -> Result<Come> {
        // A power-on message without a line end, such as a prompt, may stand directly before an
        // answer.
        let chatter = self.chatter.iter().filter(|said| !said.is_empty());
        let said = chatter.filter(|said| self.received.starts_with(said));
        if let Some(len) = said.map(Vec::len).max() {
            self.received.drain(..len);
            return Ok(Come::Chatter);
        }
        let start = match head(&self.received) {
            Head::Part => return Ok(Come::Part),
            Head::Tag(tag, at) if asked.contains(&tag) => Some(at),
            Head::Tag(..) | Head::Other => None,
        };
        // Newlines before this offset are part of a block's content.
        let mut searched = start.unwrap_or(0);
        if let Some(at) = start
            && self.received[at] == b';'
        {
            match scpi::block_header(&self.received[at + 1..]) {
                BlockPrefix::Incomplete => return Ok(Come::Part),
                BlockPrefix::Block { len, .. } if len > MAX_BLOCK_BYTES => {
                    return Err(self.failure(format!(
                        "announces a block of {len} bytes, expected at most {MAX_BLOCK_BYTES}"
                    )));
                }
                BlockPrefix::Block { prefix, len } => searched = at + 1 + prefix + len,
                BlockPrefix::Invalid => {}
            }
        }
        let tail = self.received.get(searched..).unwrap_or_default();
        let Some(end) = tail.iter().position(|&b| b == b'\n') else {
            if tail.len() > MAX_LINE_BYTES {
                self.received.clear();
                return Err(self.failure(format!(
                    "sends a line of more than {MAX_LINE_BYTES} bytes, which is not a reply"
                )));
            }
            return Ok(Come::Part);
        };
        let rest = self.received.split_off(searched + end + 1);
        let mut line = std::mem::replace(&mut self.received, rest);
        line.pop();
        // A carriage return inside a block is part of the content.
        if line.len() > searched && line.last() == Some(&b'\r') {
            line.pop();
        }
        Ok(match start {
            None if self.is_chatter(&line) => Come::Chatter,
            None => {
                line.truncate(40);
                self.junk = line;
                Come::Junk
            }
            Some(at) if at >= line.len() => Come::Answer(Answer::Void),
            Some(at) => Come::Answer(Answer::Said(line.split_off(at + 1))),
        })
    }
}

impl<P> Instrument<P> {
    /// Returns whether a line is one of the device's power-on messages, whatever its line ending.
    fn is_chatter(&self, line: &[u8]) -> bool {
        let line = line.trim_ascii();
        let mut said = self
            .chatter
            .iter()
            .flat_map(|said| said.split(|b| *b == b'\n'));
        !line.is_empty() && said.any(|said| said.trim_ascii() == line)
    }
}

/// Parses the number that a reply begins with, and the offset where it ends.
fn head(reply: &[u8]) -> Head {
    let digits = reply.iter().take_while(|b| b.is_ascii_digit()).count();
    let number = reply.get(..digits).unwrap_or_default();
    match reply.get(digits) {
        _ if digits > 3 => Head::Other,
        None => Head::Part,
        // The newline after this carriage return has not arrived yet.
        Some(b'\r') if reply.len() == digits + 1 => Head::Part,
        Some(b';' | b'\n' | b'\r') => std::str::from_utf8(number)
            .ok()
            .and_then(|number| number.parse().ok())
            .map_or(Head::Other, |tag| Head::Tag(tag, digits)),
        Some(_) => Head::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replies_begin_with_their_number() {
        for (reply, expected) in [
            (&b""[..], Head::Part),
            (b"12", Head::Part),
            (b"12\r", Head::Part),
            (b"12\r\n", Head::Tag(12, 2)),
            (b"7\n", Head::Tag(7, 1)),
            (b"255;1", Head::Tag(255, 3)),
            (b"256;1", Head::Other),
            (b"1234", Head::Other),
            (b"BUS\n", Head::Other),
            (b"-1;", Head::Other),
            (b";1", Head::Other),
            (b"\n", Head::Other),
        ] {
            assert_eq!(head(reply), expected, "{}", reply.escape_ascii());
        }
    }
}
