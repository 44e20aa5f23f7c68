//! In step with a device: which answer is to which question, and whether it has been switched off.

use super::super::TRIES;
use super::{MARKED, Spoken};
use crate::CommandPort;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::dialect::Value;
use std::time::Duration;

impl<P: CommandPort> Spoken<P> {
    /// Gets in step again with a device whose answers bear no numbers: it is told to remember a
    /// number and asked for it, and whatever comes before that one answers something else.
    pub(super) fn step(&mut self) -> Result<()> {
        if !self.line.stray {
            return Ok(());
        }
        self.line.stray = false;
        self.line.hush()?;
        if !self.is_marked() {
            return Ok(());
        }
        // The next number hides whether the device still has this one.
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
            "{}: the device does not say what it was told to remember",
            self.place(MARKED)
        )))
    }

    /// Whether the device can be told a number that it forgets when it is switched off.
    pub(super) fn is_marked(&self) -> bool {
        self.has("mark") && self.has(MARKED)
    }

    fn says_mark(&mut self) -> Result<bool> {
        let word = self.perform(MARKED, &[])?;
        Ok(word.as_ref().and_then(Value::number) == Some(f64::from(self.mark)))
    }

    /// Whether it still knows the number: an answer that says another one may be damaged, or another
    /// question's.
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

    /// From here on a device that is switched off and on is found out.
    pub(in crate::control) fn begin(&mut self) -> Result<()> {
        self.step()?;
        self.line.pass(Duration::ZERO)?;
        self.line.booted = false;
        self.forgotten = false;
        self.set_mark()
    }
}
