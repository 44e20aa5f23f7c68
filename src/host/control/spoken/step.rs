//! Synchronization with a device: matches answers to queries, and detects whether the device was
//! switched off.

use super::super::TRIES;
use super::{MARKED, Spoken};
use crate::CommandPort;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::dialect::Value;
use std::time::Duration;

impl<P: CommandPort> Spoken<P> {
    /// Synchronizes with a device whose answers carry no numbers: tells it to remember a number
    /// (mark) and queries the mark. Answers that arrive before the mark belong to earlier queries.
    pub(super) fn step(&mut self) -> Result<()> {
        if !self.line.stray {
            return Ok(());
        }
        self.line.stray = false;
        self.line.hush()?;
        if !self.is_marked() {
            return Ok(());
        }
        // Check this before the next mark overwrites the current one.
        self.forgotten |= self.mark != 0 && !self.remembers()?;
        for _ in 0..TRIES {
            self.set_mark()?;
            if self.says_mark()? {
                self.line.stray = false;
                return Ok(());
            }
            self.line.hush()?;
        }
        Err(Error::device(format!(
            "{}: the device does not return the number it was told to store",
            self.place(MARKED)
        )))
    }

    /// Returns whether the device can remember a mark, which it forgets on power-off.
    pub(super) fn is_marked(&self) -> bool {
        self.has("mark") && self.has(MARKED)
    }

    fn says_mark(&mut self) -> Result<bool> {
        let word = self.perform(MARKED, &[])?;
        Ok(word.as_ref().and_then(Value::number) == Some(f64::from(self.mark)))
    }

    /// Returns whether the device still knows its mark. Asks several times, because an answer with
    /// another number may be corrupted or belong to another query.
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

    /// Starts to watch for a power cycle of the device.
    pub(in crate::control) fn begin(&mut self) -> Result<()> {
        self.step()?;
        self.line.pass(Duration::ZERO)?;
        self.line.booted = false;
        self.forgotten = false;
        self.set_mark()
    }
}
