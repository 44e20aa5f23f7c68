//! Conversation in a dialect of lines or packets. The host makes the device remember a number, the
//! mark, and then queries it. Answers that arrive before the mark's belong to earlier queries. A
//! device that has forgotten its mark has been switched off since.

use super::conversation::{Conversation, TRIES, Values, agreed};
use super::line::Line;
use crate::CommandPort;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::dialect::{Dialect, Gather, Operation, Value};
use phasmid_protocol::printable;
use std::sync::Arc;
use std::time::Duration;

/// Maximum number of chunks in a long answer.
const MAX_PIECES: u32 = 1 << 16;
/// Name of the operation that queries the mark.
const MARKED: &str = "marked";

/// A device that speaks a dialect of lines or packets.
pub(super) struct Marked<P> {
    line: Line<P>,
    /// The mark that was last sent to the device.
    mark: u8,
    /// The device had already forgotten its mark when the next mark was sent.
    forgotten: bool,
}

impl<P: CommandPort> Marked<P> {
    pub(super) fn open(port: P, dialect: Arc<Dialect>, timeout: Duration) -> Result<Self> {
        let mut marked = Self {
            line: Line::new(port, dialect, timeout),
            mark: 0,
            forgotten: false,
        };
        // Synchronize first: an earlier client may have left answers in transit.
        if marked.step().is_err() {
            marked.recover()?;
        }
        Ok(marked)
    }

    fn operation(&self, name: &str) -> Option<Operation> {
        self.line.dialect().host().get(name).cloned()
    }

    /// Synchronizes with a device whose answers carry no numbers: answers that arrive before the
    /// new mark belong to earlier queries.
    fn step(&mut self) -> Result<()> {
        if !self.line.stray {
            return Ok(());
        }
        self.line.stray = false;
        self.line.hush()?;
        if !self.is_marked() {
            return Ok(());
        }
        // Check whether the device still knows the current mark before the next mark overwrites it.
        self.forgotten |= self.mark != 0 && !self.remembers()?;
        for _ in 0..TRIES {
            self.set_mark()?;
            if self.says_mark()? {
                self.line.stray = false;
                return Ok(());
            }
            self.line.hush()?;
        }
        let marked = self.operation(MARKED);
        let command = marked.as_ref().and_then(|marked| marked.steps.last());
        Err(Error::device(format!(
            "{}: the device does not return the number it was told to store",
            self.place(command.map_or(MARKED, |step| &step.command))
        )))
    }

    /// Returns whether the device can remember a mark, which it forgets on power-off.
    fn is_marked(&self) -> bool {
        self.operation("mark").is_some() && self.operation(MARKED).is_some()
    }

    fn says_mark(&mut self) -> Result<bool> {
        let word = self.perform(MARKED, &[])?;
        Ok(word.as_ref().and_then(Value::number) == Some(f64::from(self.mark)))
    }

    /// Returns whether the device still knows its mark. Asks several times, because an answer that
    /// differs from the mark may be corrupted or belong to another query.
    fn remembers(&mut self) -> Result<bool> {
        for _ in 0..TRIES {
            if self.says_mark()? {
                return Ok(true);
            }
            self.line.hush()?;
        }
        Ok(false)
    }

    fn set_mark(&mut self) -> Result<()> {
        self.mark = self.mark % 250 + 1;
        let mark = Value::Number(f64::from(self.mark));
        self.perform("mark", &[("mark", mark)]).map(drop)
    }

    /// Performs an operation without synchronizing first; `None` if it has no result or the dialect
    /// does not define it.
    fn perform(&mut self, operation: &str, inputs: &[(&str, Value)]) -> Result<Option<Value>> {
        let Some(operation) = self.operation(operation) else {
            return Ok(None);
        };
        let mut values = Values::new();
        for step in &operation.steps {
            values.extend(self.values(&step.command, &step.args(inputs)?)?);
        }
        Ok(operation.result(&values))
    }

    /// Performs a command without synchronizing first, and reads a long answer in pieces.
    fn values(&mut self, command: &str, args: &[(&str, Value)]) -> Result<Values> {
        let Some(chunk) = self.line.dialect().chunk(command).cloned() else {
            return self.line.ask(command, args);
        };
        let place = self.line.place(command);
        let mut read = || {
            let mut last = String::new();
            for _ in 0..TRIES {
                let mut gather = Gather::new(&chunk);
                for _ in 0..MAX_PIECES {
                    let mut args = args.to_vec();
                    args.retain(|(name, _)| *name != chunk.offset);
                    args.push(gather.ask());
                    match gather.take(&self.line.ask(command, &args)?) {
                        Ok(Some(bytes)) => return Ok(bytes),
                        Ok(None) => {}
                        Err(why) => {
                            last = why.to_string();
                            break;
                        }
                    }
                }
                // The chunks were corrupted, or belong to the answer of another query.
                self.line.hush()?;
            }
            Err(Error::device(format!("{place}: {}", printable(&last))))
        };
        let bytes = match &chunk.check {
            Some(_) => read()?,
            None => agreed(&place, read)?,
        };
        Ok(vec![(chunk.data.clone(), Value::Bytes(bytes))])
    }
}

impl<P: CommandPort> Conversation for Marked<P> {
    fn info(&self) -> &str {
        self.line.info()
    }

    fn place(&self, command: &str) -> String {
        self.line.place(command)
    }

    fn recover(&mut self) -> Result<()> {
        self.line.reopen()?;
        if self.line.hush().is_err() {
            self.line.reopen()?;
        }
        self.step()
    }

    fn begin(&mut self) -> Result<()> {
        self.step()?;
        self.line.pass(Duration::ZERO)?;
        self.line.booted = false;
        self.forgotten = false;
        self.set_mark()
    }

    fn restarted(&mut self) -> Result<bool> {
        // A power-on message may still be in transit when a run begins, so it does not prove a
        // restart during the run; a forgotten mark does.
        if !self.is_marked() {
            return Ok(self.line.booted);
        }
        self.step()?;
        Ok(self.forgotten || !self.remembers()?)
    }

    fn ask(&mut self, command: &str, args: &[(&str, Value)]) -> Result<Option<Values>> {
        self.step()?;
        self.values(command, args).map(Some)
    }

    fn send(&mut self, command: &str, args: &[(&str, Value)]) -> Result<()> {
        self.step()?;
        self.line.send(command, args)
    }

    fn hush(&mut self) -> Result<()> {
        self.line.hush()
    }
}
