//! A SCPI instrument behind a command port: commands, queries, blocks, and the device's own error
//! messages. Every query carries a number (`exchange`), so that a late or duplicated answer is
//! never taken for the answer to another query. Queries that are unanswered, corrupted or refused
//! are repeated.

mod exchange;
#[cfg(test)]
mod tests;

use super::CommandPort;
use super::deadline::Deadline;
use exchange::{ATTEMPTS, Answer};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::printable;
use phasmid_protocol::scpi;
use std::time::{Duration, Instant};

/// First value that `*ESE` is set to and queried for when a conversation starts: any IEEE 488.2
/// instrument answers `85;0`, and nothing else does. Each further attempt uses the next number.
const FIRST_MARK: u8 = 85;
const LAST_MARK: u8 = 125;
/// Maximum duration of an attempt, which is also limited to a third of the timeout. It is longer
/// than a device waits for the rest of a block that an earlier client broke off; the first attempt
/// is lost in that block.
const ASK_AGAIN: Duration = Duration::from_millis(1500);
/// Maximum number of errors read from a device's queue at a time.
const MAX_ERRORS: usize = 64;
/// Number of errors shown in a message; the others are only counted.
const SHOWN_ERRORS: usize = 5;
/// Number of times that a query is sent if it is refused or its answer is corrupted: the line may
/// be at fault.
const TRIES: u32 = 3;
/// Query of the error queue (SCPI-1999 vol 2, 21.8).
const COMPLAINTS: &str = "SYST:ERR?";
/// SCPI error number for an unknown header.
const UNDEFINED_HEADER: i32 = -113;
/// SCPI error number for a calibration that failed: the device has none.
const CALIBRATION_FAILED: i32 = -340;

/// A conversation with an instrument.
pub struct Instrument<P> {
    port: P,
    timeout: Duration,
    /// Received bytes that have not been processed yet.
    received: Vec<u8>,
    /// The number of the last query.
    tag: u8,
    /// The port has failed.
    gone: bool,
    /// The start of the last line that was not an answer.
    junk: Vec<u8>,
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

    /// [`Self::open`] for a device that sends the messages in `chatter`, in any number and order,
    /// at power-on: they are neither answers nor signs of a corrupted one.
    ///
    /// # Errors
    /// Same as [`Self::open`].
    pub fn open_chatty(port: P, chatter: Vec<Vec<u8>>, timeout: Duration) -> Result<Self> {
        let mut instrument = Self::new(port, timeout);
        instrument.chatter = chatter;
        instrument.find("\n*CLS\n")?;
        Ok(instrument)
    }

    fn new(port: P, timeout: Duration) -> Self {
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
    /// written to, aborts whatever the device waits for, and starts as [`Self::open`] does. The
    /// device's status is kept, because it may show what happened.
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

    /// Sends `first`, and queries until the answer arrives that belongs to this query alone.
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
                // Only the end is examined.
                if seen.len() > 2 * buffer.len() {
                    seen.drain(..seen.len() - buffer.len());
                }
                if len == 0 || begin.elapsed() > again {
                    break;
                }
            }
            left = left.saturating_sub(again);
            // Three thirds may not add up exactly to the whole.
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

    fn failure(&self, what: impl std::fmt::Display) -> Error {
        Error::device(format!("{}: {what}", self.info()))
    }

    /// Sends a command once, without waiting for anything.
    ///
    /// # Errors
    /// Returns an error if the port is gone or accepts no data.
    pub fn tell(&mut self, order: &str) -> Result<()> {
        self.send(order.as_bytes())
    }

    pub(super) fn send(&mut self, line: &[u8]) -> Result<()> {
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

    /// Sends a command and checks that the device accepted it. If no answer comes or the device
    /// refuses, the command is sent again, so it must be safe to execute twice.
    ///
    /// # Errors
    /// Returns the device's own error message if it did not accept the command.
    pub fn order(&mut self, order: &str) -> Result<()> {
        self.give(order, order.as_bytes())
    }

    /// Sends a command with a block as its last parameter, like [`Self::order`].
    ///
    /// # Errors
    /// Returns the device's own error message if it did not accept the command.
    pub fn order_block(&mut self, order: &str, block: &[u8]) -> Result<()> {
        let mut line = format!("{order},").into_bytes();
        line.extend(scpi::encode_block(block));
        self.give(order, &line)
    }

    /// Sends a command like [`Self::order`]; `context` names it in messages.
    ///
    /// # Errors
    /// Returns the device's own error message if it did not accept the command.
    pub(super) fn give(&mut self, context: &str, order: &[u8]) -> Result<()> {
        let mut line = order.to_vec();
        line.extend_from_slice(format!(";:{COMPLAINTS}").as_bytes());
        self.again(|instrument| match instrument.exchange(&line)? {
            None => Err(instrument.silence(context)),
            Some(Answer::Void) => Ok(Err(instrument.refusal(context)?.1)),
            Some(Answer::Said(reply)) => match instrument.error(&reply) {
                Ok(None) => Ok(Ok(())),
                Ok(Some(first)) => {
                    let complaints = instrument.complaints(vec![first])?;
                    Ok(Err(instrument.complaint(context, complaints)))
                }
                Err(damaged) => Ok(Err(damaged)),
            },
        })
    }

    /// Repeats `ask` after an inner error, which the line may have caused; an outer error is final.
    fn again<T>(&mut self, mut ask: impl FnMut(&mut Self) -> Result<Result<T>>) -> Result<T> {
        let mut tries = 1;
        loop {
            match ask(self)? {
                Err(_) if tries < TRIES => tries += 1,
                done => return done,
            }
        }
    }

    /// Queries one line. The query is repeated if the answer is missing or invalid.
    ///
    /// # Errors
    /// Returns an error if no answer comes in time, with the device's own message if it has one, or
    /// if the answer is not text.
    pub fn query(&mut self, query: &str) -> Result<String> {
        self.again(|instrument| match instrument.exchange(query.as_bytes())? {
            None => Err(instrument.silence(query)),
            Some(Answer::Void) => Ok(Err(instrument.refusal(query)?.1)),
            Some(Answer::Said(reply)) => Ok(instrument.text(query, reply)),
        })
    }

    /// Sends a query whose answer `read` parses; `context` names it in messages. The query is
    /// repeated if the answer is missing or `read` rejects it.
    ///
    /// # Errors
    /// Same as [`Self::query`].
    pub(super) fn ask<T>(
        &mut self,
        context: &str,
        line: &[u8],
        read: impl Fn(&[u8]) -> Option<T>,
    ) -> Result<T> {
        self.again(|instrument| match instrument.exchange(line)? {
            None => Err(instrument.silence(context)),
            Some(Answer::Void) => Ok(Err(instrument.refusal(context)?.1)),
            Some(Answer::Said(reply)) => {
                let read = read(&reply);
                Ok(read.ok_or_else(|| instrument.garbage(context, &reply)))
            }
        })
    }

    fn text(&self, query: &str, reply: Vec<u8>) -> Result<String> {
        match String::from_utf8(reply) {
            Ok(text) if !text.contains(char::is_control) => Ok(text),
            Ok(text) => Err(self.garbage(query, text.as_bytes())),
            Err(e) => Err(self.garbage(query, e.as_bytes())),
        }
    }

    fn garbage(&self, query: &str, reply: &[u8]) -> Error {
        let start = &reply[..reply.len().min(40)];
        self.failure(format!(
            "{query} was answered with \"{}\", which is not an answer to it",
            start.escape_ascii()
        ))
    }

    fn silence(&self, query: &str) -> Error {
        let came = match &self.junk[..] {
            [] => String::new(),
            junk => format!(" (received something else: \"{}\")", junk.escape_ascii()),
        };
        self.failure(format!(
            "no answer to {query} within {} s{came}",
            self.timeout.as_secs_f64()
        ))
    }

    /// Queries one line; returns `None` if the device does not know the query.
    ///
    /// # Errors
    /// Same as [`Self::query`].
    pub fn query_optional(&mut self, query: &str) -> Result<Option<String>> {
        self.optional(query, |instrument, reply| instrument.text(query, reply))
    }

    /// Queries a block; returns `None` if the device does not know the query or could not be
    /// calibrated.
    ///
    /// # Errors
    /// Returns an error if no answer comes in time, the answer is not a block, or the device
    /// reports any other error.
    pub fn query_block(&mut self, query: &str) -> Result<Option<Vec<u8>>> {
        self.optional(query, |instrument, reply| match scpi::split_block(&reply) {
            Some((content, [])) => Ok(content.to_vec()),
            _ => Err(instrument.garbage(query, &reply)),
        })
    }

    fn optional<T>(
        &mut self,
        query: &str,
        read: impl Fn(&Self, Vec<u8>) -> Result<T>,
    ) -> Result<Option<T>> {
        // Requires two such refusals, because a device also refuses a query that was corrupted on the
        // way as unknown.
        let mut unknown = 0;
        self.again(|instrument| match instrument.exchange(query.as_bytes())? {
            None => Err(instrument.silence(query)),
            Some(Answer::Void) => {
                let (number, error) = instrument.refusal(query)?;
                let absent = [UNDEFINED_HEADER, CALIBRATION_FAILED];
                unknown += u32::from(number.is_some_and(|number| absent.contains(&number)));
                Ok(if unknown == 2 { Ok(None) } else { Err(error) })
            }
            Some(Answer::Said(reply)) => Ok(read(instrument, reply).map(Some)),
        })
    }

    /// Returns why a query got no answer: the number of the last device error, and all errors.
    fn refusal(&mut self, query: &str) -> Result<(Option<i32>, Error)> {
        let complaints = self.complaints(Vec::new())?;
        match complaints.last() {
            None => Ok((None, self.garbage(query, b""))),
            Some(&(number, _)) => Ok((Some(number), self.complaint(query, complaints))),
        }
    }

    /// Reads the device's error queue until it is empty or the timeout has passed: a device that
    /// keeps reporting errors does not prolong the wait.
    ///
    /// # Errors
    /// Returns the device's errors in its own words: the first few, and the number of the others.
    pub fn check(&mut self, context: &str) -> Result<()> {
        match self.complaints(Vec::new())? {
            none if none.is_empty() => Ok(()),
            complaints => Err(self.complaint(context, complaints)),
        }
    }

    /// Reads the error queue and appends to the errors already read.
    fn complaints(&mut self, mut complaints: Vec<(i32, String)>) -> Result<Vec<(i32, String)>> {
        let begin = Instant::now();
        let mut damaged = 0;
        while complaints.len() < MAX_ERRORS && begin.elapsed() <= self.timeout {
            let reply = match self.exchange(COMPLAINTS.as_bytes())? {
                Some(Answer::Said(reply)) => reply,
                Some(Answer::Void) => Vec::new(),
                // Errors already read are more informative than the silence that follows.
                None if !complaints.is_empty() => break,
                None => return Err(self.silence(COMPLAINTS)),
            };
            match self.error(&reply) {
                Ok(None) => break,
                Ok(Some(complaint)) => complaints.push(complaint),
                Err(_) if damaged < TRIES => damaged += 1,
                Err(error) => return Err(error),
            }
        }
        Ok(complaints)
    }

    fn complaint(&self, context: &str, complaints: Vec<(i32, String)>) -> Error {
        let others = complaints.len().saturating_sub(SHOWN_ERRORS);
        let shown = complaints.into_iter().take(SHOWN_ERRORS);
        let mut words = shown.map(|(_, text)| text).collect::<Vec<_>>().join("; ");
        if others > 0 {
            words.push_str(&format!("; and {others} more"));
        }
        self.failure(format!("the device refuses {context}: {words}"))
    }

    /// Parses a reply to `SYSTem:ERRor?` into number and text; `None` for no error.
    fn error(&self, reply: &[u8]) -> Result<Option<(i32, String)>> {
        let text = printable(&String::from_utf8_lossy(reply));
        let number = text
            .split_once(',')
            .and_then(|(number, _)| number.trim().parse().ok());
        match number {
            Some(0) => Ok(None),
            Some(number) => Ok(Some((number, text))),
            None => Err(self.garbage(COMPLAINTS, reply)),
        }
    }
}
