//! A SCPI instrument behind a command port: commands, queries, blocks, and the device's own error
//! messages. Every query carries a number (`exchange`), so that a late or duplicated answer is
//! never taken for the answer to another query. Queries that are unanswered, corrupted or refused
//! are repeated.

mod exchange;
#[cfg(test)]
mod tests;

pub use exchange::Instrument;

use super::CommandPort;
use exchange::Answer;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::printable;
use phasmid_protocol::scpi;
use std::time::Instant;

/// Maximum number of errors read from a device's queue at a time.
const MAX_ERRORS: usize = 64;
/// Maximum number of errors that are shown in a message; further errors are only counted.
const SHOWN_ERRORS: usize = 5;
/// Maximum number of times that a query is sent if it is refused or its answer is corrupted,
/// because the line may have corrupted the query.
const TRIES: u32 = 3;
/// Query of the error queue (SCPI-1999 vol 2, 21.8).
const COMPLAINTS: &str = "SYST:ERR?";
/// SCPI error number for an unknown header.
const UNDEFINED_HEADER: i32 = -113;
/// SCPI error number for "calibration failed", which a device without a calibration reports.
const CALIBRATION_FAILED: i32 = -340;

impl<P: CommandPort> Instrument<P> {
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

    /// Repeats `ask` if it returns an inner error, which may be due to corruption on the line; an
    /// outer error is final.
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
    /// repeated if the answer is missing or `read` rejects it. `None` if the device does not know
    /// the query or has no calibration.
    ///
    /// # Errors
    /// Same as [`Self::query`].
    pub(super) fn ask<T>(
        &mut self,
        context: &str,
        line: &[u8],
        read: impl Fn(&[u8]) -> Option<T>,
    ) -> Result<Option<T>> {
        self.optional(context, line, |instrument, reply| {
            let read = read(&reply);
            read.ok_or_else(|| instrument.garbage(context, &reply))
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
        self.optional(query, query.as_bytes(), |instrument, reply| {
            instrument.text(query, reply)
        })
    }

    /// Queries a block; returns `None` if the device does not know the query or has no calibration.
    ///
    /// # Errors
    /// Returns an error if no answer comes in time, the answer is not a block, or the device
    /// reports any other error.
    pub fn query_block(&mut self, query: &str) -> Result<Option<Vec<u8>>> {
        self.ask(query, query.as_bytes(), |reply| {
            match scpi::split_block(reply) {
                Some((content, [])) => Some(content.to_vec()),
                _ => None,
            }
        })
    }

    fn optional<T>(
        &mut self,
        query: &str,
        line: &[u8],
        read: impl Fn(&Self, Vec<u8>) -> Result<T>,
    ) -> Result<Option<T>> {
        // Conclude that the query is unknown only after two such refusals, because a device may
        // report a corrupted query as unknown.
        let mut unknown = 0;
        self.again(|instrument| match instrument.exchange(line)? {
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

    /// Reads the device's error queue until it is empty or the timeout has passed, even if the
    /// device keeps reporting errors.
    ///
    /// # Errors
    /// Returns the device's errors in its own words: the first few, and the number of further errors.
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
                // Return the errors already read rather than an error about the missing answer.
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
