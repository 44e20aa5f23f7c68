//! Queries in a dialect described by a file, one at a time, on an unreliable line.

use super::conversation::Values;
use crate::CommandPort;
use crate::time::Deadline;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::dialect::{Cut, Cutter, Dialect, Direction, Event, Reply, Value};
use phasmid_protocol::printable;
use std::sync::Arc;
use std::time::Duration;

/// Maximum number of times that a query is sent if it is unanswered or refused. All attempts
/// together take at most the timeout.
const ATTEMPTS: u32 = 3;
/// Time to wait for a valid answer after an invalid answer.
const GRACE: Duration = Duration::from_millis(250);
/// Pause after a refusal, because the device may be busy. It is multiplied by the number of the
/// attempt.
const PAUSE: Duration = Duration::from_millis(20);
/// Duration of silence after which no data is assumed to be in transit.
const QUIET: Duration = Duration::from_millis(50);
/// Maximum number of bytes to accept while waiting for one answer.
const MAX_BYTES: usize = 16 << 20;

/// Result of a query.
enum Outcome {
    Done(Values),
    /// The text of the device's refusal.
    Refused(String),
    /// Description of the damage to the answer.
    Damaged(String),
    Silent,
}

/// A line to a device that speaks a dialect.
pub(super) struct Line<P> {
    port: P,
    dialect: Arc<Dialect>,
    cutter: Cutter,
    timeout: Duration,
    /// Sequence number of the last query.
    sequence: u8,
    /// Late answers to earlier queries may still arrive and cannot be distinguished from answers to
    /// the current query.
    pub(super) stray: bool,
    /// The device has reported a restart.
    pub(super) booted: bool,
    /// The port has failed.
    gone: bool,
}

impl<P: CommandPort> Line<P> {
    pub(super) fn new(port: P, dialect: Arc<Dialect>, timeout: Duration) -> Self {
        Self {
            cutter: dialect.cutter(Direction::ToHost),
            port,
            timeout,
            sequence: 0,
            stray: !dialect.has_sequence(),
            booted: false,
            gone: false,
            dialect,
        }
    }

    pub(super) fn dialect(&self) -> &Dialect {
        &self.dialect
    }

    pub(super) fn info(&self) -> &str {
        self.port.info()
    }

    /// Returns the label of a command for messages.
    pub(super) fn place(&self, command: &str) -> String {
        format!("{}: {command} ({})", self.info(), self.dialect.name())
    }

    /// Reopens the port if it has failed.
    pub(super) fn reopen(&mut self) -> Result<()> {
        if std::mem::take(&mut self.gone) {
            self.port.reopen(self.timeout)?;
        }
        self.cutter.reset();
        self.stray = !self.dialect.has_sequence();
        Ok(())
    }

    /// Sends a query, and repeats it if the answer is missing, corrupted, or a refusal: a device
    /// may be busy or have misread the query. The device may therefore execute the command more
    /// than once.
    ///
    /// # Errors
    /// Returns an error if the port is gone, if no answer comes within the timeout, or with the
    /// device's own text if it refuses.
    pub(super) fn ask(&mut self, command: &str, args: &[(&str, Value)]) -> Result<Values> {
        let mut asked = Vec::new();
        let mut error = self.silence(command);
        for attempt in 1..=ATTEMPTS {
            self.pass(Duration::ZERO)?;
            self.send(command, args)?;
            if !self.dialect.is_answered(command) {
                return Ok(Vec::new());
            }
            asked.push(self.sequence);
            let outcome = self.answer(command, &asked)?;
            // Without numbered answers, a late answer to an earlier attempt cannot be recognised.
            self.stray |= !self.dialect.has_sequence()
                && (attempt > 1 || matches!(outcome, Outcome::Damaged(_) | Outcome::Silent));
            error = match outcome {
                Outcome::Done(values) => return Ok(values),
                Outcome::Refused(words) => {
                    self.pass(PAUSE * attempt)?;
                    Error::device(format!(
                        "{}: the device refuses: {words}",
                        self.place(command)
                    ))
                }
                Outcome::Damaged(what) => {
                    self.cutter.reset();
                    Error::device(format!("{}: {what}", self.place(command)))
                }
                Outcome::Silent => {
                    self.cutter.reset();
                    self.silence(command)
                }
            };
        }
        Err(error)
    }

    fn silence(&self, command: &str) -> Error {
        Error::device(format!(
            "{}: no answer to {command} within {} s: does the device speak {}?",
            self.info(),
            self.timeout.as_secs_f64(),
            self.dialect.name()
        ))
    }

    /// Sends a command once, without waiting for an answer.
    ///
    /// # Errors
    /// Returns an error if the port is gone, or if the dialect cannot express the command.
    pub(super) fn send(&mut self, command: &str, args: &[(&str, Value)]) -> Result<()> {
        self.sequence = self.sequence.wrapping_add(1);
        let request = self.dialect.request(command, args, self.sequence);
        let place = self.place(command);
        let request = request.map_err(|e| Error::device(format!("{place}: {e}")))?;
        let sent = self.port.send(&request, self.timeout);
        self.gone |= sent.is_err();
        sent
    }

    /// Waits for the answer to a query that was sent with any of the numbers `asked`.
    fn answer(&mut self, command: &str, asked: &[u8]) -> Result<Outcome> {
        let mut deadline = Deadline::new(self.timeout / ATTEMPTS);
        let mut values = Values::new();
        let mut damaged = None;
        let mut bytes = 0;
        loop {
            let messages = self.receive(&mut deadline)?;
            let Some((messages, len)) = messages else {
                break;
            };
            bytes += len;
            let mut outcome = None;
            for cut in messages {
                let reply = match cut {
                    Cut::Message(message) => self.understand(command, &message, asked),
                    Cut::Dropped(why) => Reply::Bad(printable(&why.to_string())),
                };
                match reply {
                    // Ignore messages after the answer.
                    _ if outcome.is_some() => {}
                    Reply::More(more) => values.extend(more),
                    Reply::Done(last) => {
                        values.extend(last);
                        outcome = Some(Outcome::Done(std::mem::take(&mut values)));
                    }
                    Reply::Refused { number, text } => {
                        let words = format!("{number} {}", printable(&text));
                        outcome = Some(Outcome::Refused(words.trim_end().to_owned()));
                    }
                    Reply::Bad(why) => {
                        deadline.shorten(GRACE);
                        damaged = Some(why);
                    }
                    Reply::Event(_) | Reply::Other => {}
                }
            }
            if let Some(outcome) = outcome {
                return Ok(outcome);
            }
            if bytes > MAX_BYTES {
                damaged = Some("a reply without an end".to_owned());
                break;
            }
        }
        Ok(damaged.map_or(Outcome::Silent, Outcome::Damaged))
    }

    /// Interprets a message as an answer to a query sent with any of the numbers `asked`.
    fn understand(&mut self, command: &str, message: &[u8], asked: &[u8]) -> Reply {
        for sequence in asked.iter().rev() {
            match self.dialect.reply(command, message, *sequence) {
                Reply::Other => {}
                Reply::Event(Event::Booted) => {
                    self.booted = true;
                    return Reply::Event(Event::Booted);
                }
                reply => return reply,
            }
        }
        Reply::Other
    }

    /// Receives messages within the remaining wait, with their length in bytes; `None` when the
    /// wait is over.
    fn receive(&mut self, deadline: &mut Deadline) -> Result<Option<(Vec<Cut>, usize)>> {
        let mut buffer = [0; 4096];
        let received = deadline.receive(&mut self.port, &mut buffer);
        self.gone |= received.is_err();
        let len = received?;
        let mut cuts = Vec::new();
        self.cutter.push(&buffer[..len], &mut |cut| cuts.push(cut));
        Ok((len > 0).then_some((cuts, len)))
    }

    /// Waits for `time` and discards what arrives, but takes note of a power-on message.
    ///
    /// # Errors
    /// Returns an error if the port is gone.
    pub(super) fn pass(&mut self, time: Duration) -> Result<()> {
        let mut deadline = Deadline::new(time);
        let mut bytes = 0;
        while let Some((cuts, len)) = self.receive(&mut deadline)? {
            bytes += len;
            for cut in cuts {
                if let Cut::Message(message) = cut {
                    self.understand("", &message, &[self.sequence]);
                }
            }
            if bytes > MAX_BYTES {
                break;
            }
        }
        Ok(())
    }

    /// Waits until the line is silent.
    ///
    /// # Errors
    /// Returns an error if the port is gone.
    pub(super) fn hush(&mut self) -> Result<()> {
        self.pass(QUIET)?;
        self.cutter.reset();
        Ok(())
    }
}
