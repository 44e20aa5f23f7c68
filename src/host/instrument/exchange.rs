//! Questions that know their answers. SCPI numbers nothing, and a line may lose, delay, double or
//! damage what it carries. So each question begins with `*ESE n;*ESE?;`, and its answer with `n;`:
//! any instrument of IEEE 488.2 keeps that number for whoever set it (11.5.1.3), over a serial line
//! nobody else has a use for it, and an answer to another question, or to nobody's, has another one.

use super::Instrument;
use crate::CommandPort;
use crate::patience::Patience;
use phasmid_core::error::Result;
use phasmid_protocol::scpi::{self, BlockPrefix, MAX_BLOCK_BYTES, MAX_LINE_BYTES};
use std::time::{Duration, Instant};

/// How often a question is asked while nothing comes; they share the timeout.
pub(super) const ATTEMPTS: u32 = 3;
/// How long to wait for an answer behind a line that is none.
const GRACE: Duration = Duration::from_millis(250);

/// What a device says to a question.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Answer {
    /// Nothing: it has not understood the question, or refuses it.
    Void,
    /// This, without the newline.
    Said(Vec<u8>),
}

/// What has come so far.
#[derive(Debug, PartialEq, Eq)]
enum Come {
    /// Not a whole line.
    Part,
    /// A line that is no answer to the question.
    Junk,
    /// What a device says that has been switched on; there may be an answer behind it.
    Chatter,
    Answer(Answer),
}

/// How a reply begins.
#[derive(Debug, PartialEq, Eq)]
enum Head {
    /// Too little to tell.
    Part,
    /// With this number, up to this offset.
    Tag(u8, usize),
    /// With something else.
    Other,
}

impl<P: CommandPort> Instrument<P> {
    /// Asks, and asks again while nothing comes that bears the question's number; `None` when
    /// nothing has in all of the timeout. What is asked may have been done more than once.
    ///
    /// # Errors
    /// A port that has gone, and a device that sends without an end.
    pub(super) fn exchange(&mut self, body: &[u8]) -> Result<Option<Answer>> {
        self.junk.clear();
        let mut asked = Vec::new();
        let mut buffer = [0; 16 << 10];
        let begin = Instant::now();
        for attempt in 0..ATTEMPTS {
            self.tag = self.tag.checked_add(1).unwrap_or(1);
            asked.push(self.tag);
            self.received.clear();
            // A newline first ends what a damaged one has left open.
            let end = if attempt == 0 { "" } else { "\n" };
            let mut line = format!("{end}*ESE {tag};*ESE?;", tag = self.tag).into_bytes();
            line.extend_from_slice(body);
            self.send(&line)?;
            let part = self.timeout / ATTEMPTS;
            let mut patience = Patience::new(part);
            let mut bytes = 0;
            loop {
                match self.look(&asked)? {
                    Come::Answer(answer) => return Ok(Some(answer)),
                    Come::Junk => {
                        patience.shorten(GRACE);
                        continue;
                    }
                    Come::Chatter => continue,
                    Come::Part => {}
                }
                // A long answer on a slow line is no silence, until it has taken too long; one that
                // has come is one.
                if bytes > 0 && begin.elapsed() > 2 * self.timeout {
                    break;
                }
                let len = self.receive(&mut patience, &mut buffer)?;
                bytes += len;
                if len == 0 || bytes > 2 * MAX_BLOCK_BYTES {
                    break;
                }
                self.received.extend_from_slice(&buffer[..len]);
                if matches!(head(&self.received), Head::Tag(tag, _) if asked.contains(&tag)) {
                    patience = Patience::new(part);
                }
            }
        }
        self.received.clear();
        Ok(None)
    }

    /// Looks at the first line that has come, and takes it where it is whole.
    fn look(&mut self, asked: &[u8]) -> Result<Come> {
        // Chatter without an end of its line, such as a prompt, stands before an answer.
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
        // Newlines before this offset are content.
        let mut searched = start.unwrap_or(0);
        if let Some(at) = start
            && self.received[at] == b';'
        {
            match scpi::block_header(&self.received[at + 1..]) {
                BlockPrefix::Incomplete => return Ok(Come::Part),
                BlockPrefix::Block { len, .. } if len > MAX_BLOCK_BYTES => {
                    return Err(self.failure(format!(
                        "announces a block of {len} bytes, at most {MAX_BLOCK_BYTES} are taken"
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
                    "sends a line of more than {MAX_LINE_BYTES} bytes, which is no reply"
                )));
            }
            return Ok(Come::Part);
        };
        let rest = self.received.split_off(searched + end + 1);
        let mut line = std::mem::replace(&mut self.received, rest);
        line.pop();
        // A carriage return inside of a block is content.
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
    /// Whether a line is one of those that the device says when it is switched on, however it ends.
    fn is_chatter(&self, line: &[u8]) -> bool {
        let line = line.trim_ascii();
        let mut said = self
            .chatter
            .iter()
            .flat_map(|said| said.split(|b| *b == b'\n'));
        !line.is_empty() && said.any(|said| said.trim_ascii() == line)
    }
}

/// The number that a reply begins with, and where it ends.
fn head(reply: &[u8]) -> Head {
    let digits = reply.iter().take_while(|b| b.is_ascii_digit()).count();
    let number = reply.get(..digits).unwrap_or_default();
    match reply.get(digits) {
        _ if digits > 3 => Head::Other,
        None => Head::Part,
        // A carriage return and its newline.
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
