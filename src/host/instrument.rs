//! A SCPI instrument behind a command port: orders, queries, blocks, and the device's own words
//! when something is wrong.

use super::CommandPort;
use crate::error::{Error, Result};
use crate::protocol::printable;
use crate::protocol::scpi::{self, MAX_BLOCK_BYTES, MAX_LINE_BYTES};
use std::time::{Duration, Instant};

/// What `*ESE` is set to and asked for when a conversation starts: any instrument of IEEE 488.2
/// answers `85;0`, and nothing else does. Each further attempt has the next number.
const FIRST_MARK: u8 = 85;
const LAST_MARK: u8 = 125;
/// How long an attempt may take: longer than a device waits for the rest of a block that an earlier
/// client broke off, in which the first attempt is lost.
const ASK_AGAIN: Duration = Duration::from_millis(1500);
/// Errors that are read from a device before it is told to forget the rest.
const MAX_ERRORS: usize = 64;
/// Errors that are shown; the others are counted.
const SHOWN_ERRORS: usize = 5;

/// A conversation with an instrument.
pub struct Instrument<P> {
    port: P,
    timeout: Duration,
    /// What has come and has not been asked for yet.
    received: Vec<u8>,
}

impl<P: CommandPort> Instrument<P> {
    /// Starts a conversation: ends an unfinished line, clears the status, and skips whatever was
    /// under way until the answer to a question that nobody else asks. `timeout` bounds this wait
    /// and every later one.
    ///
    /// # Errors
    /// A port that has gone, or one behind which nobody answers as IEEE 488.2 has it.
    pub fn open(port: P, timeout: Duration) -> Result<Self> {
        let mut instrument = Self {
            port,
            timeout,
            received: Vec::new(),
        };
        let end = Instant::now() + timeout;
        let mut buffer = [0; 4096];
        let mut seen = Vec::new();
        for mark in FIRST_MARK.. {
            let query = format!("*ESE {mark};*ESE?;*ESE 0;*ESE?");
            instrument.send(format!("\n*CLS\n{query}").as_bytes())?;
            let answer = format!("{mark};0");
            let again = (Instant::now() + ASK_AGAIN).min(end);
            loop {
                let left = again.saturating_duration_since(Instant::now());
                let len = instrument.port.receive(&mut buffer, left)?;
                seen.extend_from_slice(&buffer[..len]);
                if seen.ends_with(b"\n") && seen.trim_ascii_end().ends_with(answer.as_bytes()) {
                    return Ok(instrument);
                }
                // Only the end is looked at.
                if seen.len() > 2 * buffer.len() {
                    seen.drain(..seen.len() - buffer.len());
                }
                if len == 0 || left.is_zero() {
                    break;
                }
            }
            if mark == LAST_MARK || Instant::now() >= end {
                break;
            }
        }
        let last = &seen[seen.len() - seen.len().min(40)..];
        Err(instrument.failure(format!(
            "no answer to *ESE? within {} s (the last that came was \"{}\"): is it a SCPI \
             instrument?",
            timeout.as_secs_f64(),
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

    /// Sends an order without waiting for anything.
    ///
    /// # Errors
    /// A port that has gone or takes nothing.
    pub fn tell(&mut self, order: &str) -> Result<()> {
        self.send(order.as_bytes())
    }

    fn send(&mut self, line: &[u8]) -> Result<()> {
        let mut line = line.to_vec();
        line.push(b'\n');
        self.port.send(&line, self.timeout)
    }

    /// Sends an order and asks whether the device took it.
    ///
    /// # Errors
    /// The device's own words when it did not.
    pub fn order(&mut self, order: &str) -> Result<()> {
        self.tell(order)?;
        self.check(order)
    }

    /// Sends an order with a block as its last parameter and asks whether the device took it.
    ///
    /// # Errors
    /// The device's own words when it did not.
    pub fn order_block(&mut self, order: &str, block: &[u8]) -> Result<()> {
        let mut line = format!("{order},").into_bytes();
        line.extend(scpi::encode_block(block));
        self.send(&line)?;
        self.check(order)
    }

    /// Asks for one line.
    ///
    /// # Errors
    /// No answer in time, with the device's own words if it has any, or one that is no text.
    pub fn query(&mut self, query: &str) -> Result<String> {
        self.tell(query)?;
        match self.reply()? {
            Some(reply) => self.text(query, reply),
            None => {
                self.check(query)?;
                Err(self.silence(query))
            }
        }
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
        self.failure(format!(
            "no answer to {query} within {} s",
            self.timeout.as_secs_f64()
        ))
    }

    /// Asks for a block; `None` when the device does not know the question.
    ///
    /// # Errors
    /// No answer in time, one that is no block, or any other complaint of the device.
    pub fn query_block(&mut self, query: &str) -> Result<Option<Vec<u8>>> {
        // The error queue is asked in the same breath: a device that does not know the question
        // says nothing to it, and its silence would cost the whole timeout.
        self.tell(query)?;
        self.tell("SYST:ERR?")?;
        let Some(reply) = self.reply()? else {
            return Err(self.silence(query));
        };
        if let Some((content, rest)) = scpi::split_block(&reply)
            && rest.is_empty()
        {
            let content = content.to_vec();
            let Some(error) = self.reply()? else {
                return Err(self.silence("SYST:ERR?"));
            };
            return match self.error(&error)? {
                None => Ok(Some(content)),
                Some((_, text)) => Err(self.complaint(query, &text)),
            };
        }
        match self.error(&reply)? {
            Some((-113, _)) => Ok(None),
            Some((_, text)) => Err(self.complaint(query, &text)),
            None => Err(self.garbage(query, &reply)),
        }
    }

    fn complaint(&self, order: &str, text: &str) -> Error {
        self.failure(format!("the device refuses {order}: {text}"))
    }

    /// Reads the device's error queue until it is empty, or until the timeout: a device that has
    /// more to say each time does not prolong the wait.
    ///
    /// # Errors
    /// What the device complains of, in its own words: the first complaints and the number of the
    /// others.
    pub fn check(&mut self, context: &str) -> Result<()> {
        let end = Instant::now() + self.timeout;
        let mut complaints = Vec::new();
        while complaints.len() < MAX_ERRORS {
            self.tell("SYST:ERR?")?;
            match self.reply_until(end)? {
                // A complaint that has come says more than the silence after it.
                None if !complaints.is_empty() => break,
                None => return Err(self.silence("SYST:ERR?")),
                Some(reply) => match self.error(&reply)? {
                    Some((_, text)) => complaints.push(text),
                    None => break,
                },
            }
        }
        if complaints.is_empty() {
            return Ok(());
        }
        let others = complaints.len().saturating_sub(SHOWN_ERRORS);
        complaints.truncate(SHOWN_ERRORS);
        let mut words = complaints.join("; ");
        if others > 0 {
            words.push_str(&format!("; and {others} more"));
        }
        Err(self.complaint(context, &words))
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
            None => Err(self.garbage("SYST:ERR?", reply)),
        }
    }

    /// One reply without its newline; `None` when it has not come whole in time.
    fn reply(&mut self) -> Result<Option<Vec<u8>>> {
        self.reply_until(Instant::now() + self.timeout)
    }

    fn reply_until(&mut self, end: Instant) -> Result<Option<Vec<u8>>> {
        let mut buffer = [0; 16 << 10];
        // Newlines before this offset are content, or have been looked for in vain.
        let mut searched = 0;
        loop {
            if let scpi::BlockPrefix::Block { prefix, len } = scpi::block_header(&self.received) {
                if len > MAX_BLOCK_BYTES {
                    return Err(self.failure(format!(
                        "announces a block of {len} bytes, at most {MAX_BLOCK_BYTES} are taken"
                    )));
                }
                searched = searched.max(prefix + len);
            }
            let tail = self.received.get(searched..).unwrap_or_default();
            if let Some(at) = tail.iter().position(|&b| b == b'\n') {
                let rest = self.received.split_off(searched + at + 1);
                let mut reply = std::mem::replace(&mut self.received, rest);
                reply.pop();
                // A carriage return inside of a block is content.
                if reply.len() > searched && reply.last() == Some(&b'\r') {
                    reply.pop();
                }
                return Ok(Some(reply));
            }
            if tail.len() > MAX_LINE_BYTES {
                self.received.clear();
                return Err(self.failure(format!(
                    "sends a line of more than {MAX_LINE_BYTES} bytes, which is no reply"
                )));
            }
            let left = end.saturating_duration_since(Instant::now());
            let len = self.port.receive(&mut buffer, left)?;
            if len == 0 {
                // Half a reply must not become the beginning of the next one.
                self.received.clear();
                return Ok(None);
            }
            self.received.extend_from_slice(&buffer[..len]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::MemoryPort;
    use super::*;

    const SHORT: Duration = Duration::from_millis(30);
    const LONG: Duration = Duration::from_secs(60);

    /// An instrument that answers each line by a list.
    fn instrument(
        answers: &'static [(&'static str, &'static [u8])],
    ) -> Instrument<MemoryPort<impl FnMut(&[u8]) -> Vec<u8>>> {
        let device = move |line: &[u8]| {
            if line.ends_with(b"*ESE 85;*ESE?;*ESE 0;*ESE?\n") {
                return b"stale\n85;0\r\n".to_vec();
            }
            answers
                .iter()
                .filter(|(query, _)| line == format!("{query}\n").as_bytes())
                .flat_map(|(_, answer)| answer.to_vec())
                .collect()
        };
        Instrument::open(MemoryPort::new(device), SHORT).unwrap()
    }

    const FINE: (&str, &[u8]) = ("SYST:ERR?", b"0,\"No error\"\r\n");

    #[test]
    fn lines_blocks_and_questions_that_are_not_known() {
        let mut fine = instrument(&[
            ("*IDN?", b"a,b,c,d\n"),
            ("DATA?", b"#15a\n;#9\n"),
            ("CR?", b"#11\r\r\n"),
            ("LINE?", b"text\n"),
            ("NOISE?", b"\xff\xfe\n"),
            FINE,
        ]);
        assert_eq!(fine.query("*IDN?").unwrap(), "a,b,c,d");
        assert_eq!(fine.query_block("DATA?").unwrap().unwrap(), b"a\n;#9");
        assert_eq!(fine.query_block("CR?").unwrap().unwrap(), b"\r");
        fine.order("*RST").unwrap();
        for (result, needle) in [
            (fine.query("SILENT?"), "no answer to SILENT? within 0.03 s"),
            (fine.query("NOISE?"), "no answer to it"),
            (
                fine.query_block("LINE?").map(|_| String::new()),
                "SYST:ERR?",
            ),
        ] {
            let message = result.unwrap_err().to_string();
            assert!(message.contains(needle), "{needle} not in: {message}");
        }
        let mut unknown = instrument(&[("SYST:ERR?", b"-113,\"Undefined header\"\n")]);
        assert_eq!(unknown.query_block("DATA?").unwrap(), None);
        let mut refuses = instrument(&[("SYST:ERR?", b"-222,\"Data out of range;x\"\n")]);
        let message = refuses.order("CAM:EXP 9").unwrap_err().to_string();
        assert!(
            message.contains("-222,\"Data out of range;x\""),
            "{message}"
        );
        assert!(message.contains("CAM:EXP 9"), "{message}");
    }

    #[test]
    fn a_device_s_words_cannot_steer_a_terminal() {
        let mut instrument = instrument(&[(
            "SYST:ERR?",
            b"-300,\"\x1b]0;owned\x07\x1b[2J\xc2\x9b1m\xe2\x80\xae\r\xc3\xa9\\\"\n",
        )]);
        let message = instrument.check("*RST").unwrap_err().to_string();
        assert!(!message.contains(char::is_control), "{message:?}");
        assert!(!message.contains('\u{202e}'), "{message:?}");
        let needle = "-300,\"\\u{1b}]0;owned\\u{7}\\u{1b}[2J\\u{9b}1m\\u{202e}\\r\u{e9}\\\"";
        assert!(message.contains(needle), "{message}");
    }

    /// Answers every question with an error, each after a while.
    struct Complainer {
        pause: Duration,
        asked: u32,
        answered: u32,
    }

    impl CommandPort for Complainer {
        fn info(&self) -> &str {
            "complainer"
        }

        fn send(&mut self, bytes: &[u8], _timeout: Duration) -> Result<()> {
            self.asked += u32::from(bytes == b"SYST:ERR?\n");
            Ok(())
        }

        fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize> {
            std::thread::sleep(self.pause.min(timeout));
            if self.pause > timeout || self.answered == self.asked {
                return Ok(0);
            }
            self.answered += 1;
            let reply = format!("-300,\"no. {}\"\n", self.answered);
            buffer[..reply.len()].copy_from_slice(reply.as_bytes());
            Ok(reply.len())
        }
    }

    #[test]
    fn a_device_that_goes_on_complaining_is_cut_short() {
        for (pause, timeout, needle) in [
            (Duration::ZERO, LONG, "-300,\"no. 5\"; and 59 more"),
            (SHORT / 4, SHORT, "-300,\"no. 1\""),
        ] {
            let mut instrument = Instrument {
                port: Complainer {
                    pause,
                    asked: 0,
                    answered: 0,
                },
                timeout,
                received: Vec::new(),
            };
            let start = Instant::now();
            let message = instrument.order("*RST").unwrap_err().to_string();
            assert!(message.contains(needle), "{message}");
            assert!(message.matches("-300").count() <= 5, "{message}");
            assert!(start.elapsed() < 20 * SHORT, "{:?}", start.elapsed());
        }
    }

    #[test]
    fn a_device_that_never_stops_is_given_up() {
        let endless = MemoryPort::new(|_: &[u8]| vec![b'x'; 1 << 20]);
        let mut instrument = Instrument {
            port: endless,
            timeout: SHORT,
            received: Vec::new(),
        };
        let message = instrument.query("*IDN?").unwrap_err().to_string();
        assert!(message.contains("no reply"), "{message}");
        let huge = MemoryPort::new(|_: &[u8]| b"#9999999999".to_vec());
        let mut instrument = Instrument {
            port: huge,
            timeout: SHORT,
            received: Vec::new(),
        };
        assert!(instrument.query_block("DATA?").is_err());
    }
}
