//! A SCPI instrument behind a command port: orders, queries, blocks, and the device's own words
//! when something is wrong. Every question bears a number (`exchange`), so that no late or doubled
//! answer is taken for another one's; what is silent, damaged or refused is asked again.

mod exchange;
#[cfg(test)]
mod tests;

use super::CommandPort;
use super::patience::Patience;
use exchange::{ATTEMPTS, Answer};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::printable;
use phasmid_protocol::scpi;
use std::time::{Duration, Instant};

/// What `*ESE` is set to and asked for when a conversation starts: any instrument of IEEE 488.2
/// answers `85;0`, and nothing else does. Each further attempt has the next number.
const FIRST_MARK: u8 = 85;
const LAST_MARK: u8 = 125;
/// How long an attempt may take, a third of the timeout at most: longer than a device waits for the
/// rest of a block that an earlier client broke off, in which the first attempt is lost.
const ASK_AGAIN: Duration = Duration::from_millis(1500);
/// Errors that are read from a device before it is told to forget the rest.
const MAX_ERRORS: usize = 64;
/// Errors that are shown; the others are counted.
const SHOWN_ERRORS: usize = 5;
/// How often a question is asked that is refused, or whose answer is damaged: the line may have
/// done that to it.
const TRIES: u32 = 3;
/// Where a device keeps its complaints (SCPI-1999 vol 2, 21.8).
const COMPLAINTS: &str = "SYST:ERR?";
/// Number of a header that the device does not have.
const UNDEFINED_HEADER: i32 = -113;

/// A conversation with an instrument.
pub struct Instrument<P> {
    port: P,
    timeout: Duration,
    /// What has come and has not been looked at yet.
    received: Vec<u8>,
    /// The number of the last question.
    tag: u8,
    /// The port has failed.
    gone: bool,
    /// The start of the last line that was no answer.
    junk: Vec<u8>,
    /// What the device says of its own accord when it is switched on.
    chatter: Vec<Vec<u8>>,
}

impl<P: CommandPort> Instrument<P> {
    /// Starts a conversation: ends an unfinished line, clears the status, and skips whatever was
    /// under way until the answer to a question that nobody else asks. `timeout` bounds this wait
    /// and every later one.
    ///
    /// # Errors
    /// A port that has gone, or one behind which nobody answers as IEEE 488.2 has it.
    pub fn open(port: P, timeout: Duration) -> Result<Self> {
        Self::open_chatty(port, Vec::new(), timeout)
    }

    /// [`Self::open`] for a device that says these bytes, in any number and order, when it is switched
    /// on: they are no answers, and no sign of a damaged one.
    ///
    /// # Errors
    /// As for [`Self::open`].
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

    /// Finds a device again that has been silent or has gone: opens the port anew where it cannot
    /// be sent to, ends whatever the device waits for, and starts as [`Self::open`] does. The
    /// device's status stays, for it may say what has happened.
    ///
    /// # Errors
    /// As for [`Self::open`], and a port that does not come back within the timeout.
    pub fn recover(&mut self) -> Result<()> {
        // Alone on its line it acts even where the device waits for a trigger.
        self.find("\nABOR\n")
    }

    /// Greets, and once more on a port that was opened anew where it has gone.
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

    /// Sends `first`, and asks until the answer comes that nobody else's question has.
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
            let mut patience = Patience::new(again);
            loop {
                let len = self.receive(&mut patience, &mut buffer)?;
                seen.extend_from_slice(&buffer[..len]);
                if seen.ends_with(b"\n") && seen.trim_ascii_end().ends_with(answer.as_bytes()) {
                    return Ok(());
                }
                // Only the end is looked at.
                if seen.len() > 2 * buffer.len() {
                    seen.drain(..seen.len() - buffer.len());
                }
                if len == 0 || begin.elapsed() > again {
                    break;
                }
            }
            left = left.saturating_sub(again);
            // Thirds do not always make a whole.
            if left < self.timeout / 100 {
                break;
            }
        }
        let last = &seen[seen.len() - seen.len().min(40)..];
        Err(self.failure(format!(
            "no answer to *ESE? within {} s (the last that came was \"{}\"): is it a SCPI \
             instrument? If not, --dialect says what it speaks",
            self.timeout.as_secs_f64(),
            last.escape_ascii()
        )))
    }

    /// The port's path, for messages.
    pub fn info(&self) -> &str {
        self.port.info()
    }

    fn failure(&self, what: impl std::fmt::Display) -> Error {
        Error::device(format!("{}: {what}", self.info()))
    }

    /// Sends an order once, without waiting for anything.
    ///
    /// # Errors
    /// A port that has gone or takes nothing.
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

    fn receive(&mut self, patience: &mut Patience, buffer: &mut [u8]) -> Result<usize> {
        let received = patience.receive(&mut self.port, buffer);
        self.gone |= received.is_err();
        received
    }

    /// Gives an order and asks whether the device took it. It is given again where no answer comes
    /// or the device refuses it: it must do no harm twice.
    ///
    /// # Errors
    /// The device's own words when it did not.
    pub fn order(&mut self, order: &str) -> Result<()> {
        self.give(order, order.as_bytes())
    }

    /// Gives an order with a block as its last parameter, as [`Self::order`] does.
    ///
    /// # Errors
    /// The device's own words when it did not.
    pub fn order_block(&mut self, order: &str, block: &[u8]) -> Result<()> {
        let mut line = format!("{order},").into_bytes();
        line.extend(scpi::encode_block(block));
        self.give(order, &line)
    }

    /// Gives an order as [`Self::order`] does; `context` names it in messages.
    ///
    /// # Errors
    /// The device's own words when it did not.
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

    /// Tries until it works: the inner error is what the line may have done.
    fn again<T>(&mut self, mut ask: impl FnMut(&mut Self) -> Result<Result<T>>) -> Result<T> {
        let mut tries = 1;
        loop {
            match ask(self)? {
                Err(_) if tries < TRIES => tries += 1,
                done => return done,
            }
        }
    }

    /// Asks for one line. It is asked again where no answer comes, or one that is none.
    ///
    /// # Errors
    /// No answer in time, with the device's own words if it has any, or one that is no text.
    pub fn query(&mut self, query: &str) -> Result<String> {
        self.again(|instrument| match instrument.exchange(query.as_bytes())? {
            None => Err(instrument.silence(query)),
            Some(Answer::Void) => Ok(Err(instrument.refusal(query)?.1)),
            Some(Answer::Said(reply)) => Ok(instrument.text(query, reply)),
        })
    }

    /// Asks a question whose answer `read` understands; `context` names it in messages. It is asked
    /// again where no answer comes, or one that `read` does not take.
    ///
    /// # Errors
    /// As for [`Self::query`].
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
            "{query} was answered with \"{}\", which is no answer to it",
            start.escape_ascii()
        ))
    }

    fn silence(&self, query: &str) -> Error {
        let came = match &self.junk[..] {
            [] => String::new(),
            junk => format!(
                " (what came is no answer to it: \"{}\")",
                junk.escape_ascii()
            ),
        };
        self.failure(format!(
            "no answer to {query} within {} s{came}",
            self.timeout.as_secs_f64()
        ))
    }

    /// Asks for one line; `None` when the device does not know the question.
    ///
    /// # Errors
    /// As for [`Self::query`].
    pub fn query_optional(&mut self, query: &str) -> Result<Option<String>> {
        self.optional(query, |instrument, reply| instrument.text(query, reply))
    }

    /// Asks for a block; `None` when the device does not know the question.
    ///
    /// # Errors
    /// No answer in time, one that is no block, or any other complaint of the device.
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
        // Twice, for a damaged question is not known either.
        let mut unknown = 0;
        self.again(|instrument| match instrument.exchange(query.as_bytes())? {
            None => Err(instrument.silence(query)),
            Some(Answer::Void) => {
                let (number, error) = instrument.refusal(query)?;
                unknown += u32::from(number == Some(UNDEFINED_HEADER));
                Ok(if unknown == 2 { Ok(None) } else { Err(error) })
            }
            Some(Answer::Said(reply)) => Ok(read(instrument, reply).map(Some)),
        })
    }

    /// Why a question got no answer: number of the last complaint, and all of them.
    fn refusal(&mut self, query: &str) -> Result<(Option<i32>, Error)> {
        let complaints = self.complaints(Vec::new())?;
        match complaints.last() {
            None => Ok((None, self.garbage(query, b""))),
            Some(&(number, _)) => Ok((Some(number), self.complaint(query, complaints))),
        }
    }

    /// Reads the device's error queue until it is empty, or until the timeout: a device that has
    /// more to say each time does not prolong the wait.
    ///
    /// # Errors
    /// What the device complains of, in its own words: the first complaints and the number of the
    /// others.
    pub fn check(&mut self, context: &str) -> Result<()> {
        match self.complaints(Vec::new())? {
            none if none.is_empty() => Ok(()),
            complaints => Err(self.complaint(context, complaints)),
        }
    }

    /// The error queue, behind what has been read of it.
    fn complaints(&mut self, mut complaints: Vec<(i32, String)>) -> Result<Vec<(i32, String)>> {
        let begin = Instant::now();
        let mut damaged = 0;
        while complaints.len() < MAX_ERRORS && begin.elapsed() <= self.timeout {
            let reply = match self.exchange(COMPLAINTS.as_bytes())? {
                Some(Answer::Said(reply)) => reply,
                Some(Answer::Void) => Vec::new(),
                // A complaint that has come says more than the silence after it.
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

    /// Number and text of a reply to `SYSTem:ERRor?`; `None` for no error.
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
