//! Conversation with a SCPI device. The commands come from the dialect's file; line endings, the
//! numbering of answers, refusals and the detection of a power cycle follow IEEE 488.2.

use super::conversation::{Conversation, Values};
use crate::{CommandPort, Instrument};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::dialect::{Dialect, Reply, Value};
use std::sync::Arc;
use std::time::Duration;

/// Query of the event register (IEEE 488.2, 11.5.1.2), which is cleared by reading it.
const EVENTS: &str = "*ESR?";
/// The bit of the event register that is set at power-on.
const POWER_ON: u8 = 1 << 7;

/// The conversation with a scanner that is a SCPI instrument.
pub(super) struct Scpi<P> {
    instrument: Instrument<P>,
    dialect: Arc<Dialect>,
    /// The device has reported a power cycle.
    restarted: bool,
}

impl<P: CommandPort> Scpi<P> {
    pub(super) fn open(port: P, dialect: Arc<Dialect>, timeout: Duration) -> Result<Self> {
        // Power-on messages are skipped, not taken as evidence of a restart: they may still be in
        // transit when a run begins.
        let chatter = dialect.boot().iter().map(|boot| boot.bytes.clone());
        Ok(Self {
            instrument: Instrument::open_chatty(port, chatter.collect(), timeout)?,
            dialect,
            restarted: false,
        })
    }

    pub(super) fn instrument(&mut self) -> &mut Instrument<P> {
        &mut self.instrument
    }

    /// Reads the device's error queue. The query for it is defined by SCPI, not by the dialect's
    /// file.
    ///
    /// # Errors
    /// Returns the errors that the device reports.
    pub(super) fn complaints(&mut self) -> Result<()> {
        self.instrument.check("INIT;*TRG")
    }

    /// Returns the line of a command, without its terminator.
    fn line(&self, command: &str, args: &[(&str, Value)]) -> Result<Vec<u8>> {
        let line = self.dialect.request(command, args, 0);
        let place = || format!("{} ({})", self.place(command), self.dialect.name());
        let mut line = line.map_err(|e| Error::device(format!("{}: {e}", place())))?;
        line.truncate(line.trim_ascii_end().len());
        Ok(line)
    }
}

impl<P: CommandPort> Conversation for Scpi<P> {
    fn info(&self) -> &str {
        self.instrument.info()
    }

    fn place(&self, command: &str) -> String {
        format!("{}: {}", self.info(), self.dialect.label(command))
    }

    fn recover(&mut self) -> Result<()> {
        self.instrument.recover()
    }

    fn begin(&mut self) -> Result<()> {
        self.restarted = false;
        self.instrument.order("*CLS")
    }

    fn restarted(&mut self) -> Result<bool> {
        if let Some(events) = self.instrument.query_optional(EVENTS)? {
            // Reading clears the register, so a damaged answer may hide a power cycle: assume that
            // there was a power cycle.
            let events = events.parse().map_or(POWER_ON, |events: f64| events as u8);
            self.restarted |= events & POWER_ON != 0;
        }
        Ok(self.restarted)
    }

    fn ask(&mut self, command: &str, args: &[(&str, Value)]) -> Result<Option<Values>> {
        let line = self.line(command, args)?;
        let context = String::from_utf8_lossy(&line);
        if !self.dialect.is_answered(command) {
            self.instrument.give(&context, &line)?;
            return Ok(Some(Values::new()));
        }
        let dialect = &self.dialect;
        self.instrument.ask(&context, &line, |reply| {
            match dialect.reply(command, reply, 0) {
                Reply::Done(values) => Some(values),
                _ => None,
            }
        })
    }

    fn send(&mut self, command: &str, args: &[(&str, Value)]) -> Result<()> {
        let line = self.line(command, args)?;
        self.instrument.send(&line)
    }

    fn hush(&mut self) -> Result<()> {
        Ok(())
    }
}
