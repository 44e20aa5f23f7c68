//! Selects the commands for an operation: the device's own, defined by the file `scpi`, unless a
//! dialect file overrides them.

use crate::{CommandPort, Instrument};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::dialect::{Dialect, Operation, Reply, Step, Value};

/// The commands used in a conversation.
pub(super) struct Words {
    /// The device's own commands.
    own: Dialect,
    file: Option<Dialect>,
}

/// Commands that perform one of the operations of a scan.
pub(super) enum Wording<'a> {
    /// The device's own commands.
    Own,
    /// The commands of a file.
    File(Worded<'a>),
    /// The file does not define the operation; a scan skips it.
    None,
}

/// An operation with a file's commands.
pub(super) struct Worded<'a> {
    dialect: &'a Dialect,
    operation: &'a Operation,
}

impl Words {
    pub(super) fn new(file: Option<Dialect>) -> Result<Self> {
        let own = Dialect::load("scpi")?;
        Ok(Self { own, file })
    }

    pub(super) fn language(&self) -> &str {
        match &self.file {
            Some(file) if file.name() != self.own.name() => file.name(),
            _ => "SCPI",
        }
    }

    /// Returns the messages that the device sends unprompted at power-on. They are skipped, because
    /// they may still be in transit when a run begins; a power cycle is detected by a query
    /// (`*ESR?`) instead.
    pub(super) fn chatter(&self) -> Vec<Vec<u8>> {
        let boot = self.file.iter().flat_map(Dialect::boot);
        boot.map(|boot| boot.bytes.clone()).collect()
    }

    pub(super) fn of(&self, operation: &str) -> Wording<'_> {
        let Some(dialect) = &self.file else {
            return Wording::Own;
        };
        match dialect.host().get(operation) {
            None => Wording::None,
            Some(_) if dialect.does_alike(&self.own, operation) => Wording::Own,
            Some(operation) => Wording::File(Worded { dialect, operation }),
        }
    }
}

impl Worded<'_> {
    /// Returns the name of the operation for messages: its last command.
    pub(super) fn name(&self) -> String {
        let step = self.operation.steps.last();
        let command = step.map_or("", |step| step.command.as_str());
        format!("{command} ({})", self.dialect.name())
    }

    /// Performs all steps; returns the result if the operation has one.
    ///
    /// # Errors
    /// Returns an error if the port fails, the device refuses, or the dialect cannot express a
    /// step.
    pub(super) fn perform<P: CommandPort>(
        &self,
        instrument: &mut Instrument<P>,
        inputs: &[(&str, Value)],
    ) -> Result<Option<Value>> {
        let mut values = Vec::new();
        for step in &self.operation.steps {
            let line = self.line(instrument, step, inputs)?;
            let command = &step.command;
            if !self.dialect.is_answered(command) {
                instrument.give(command, &line)?;
                continue;
            }
            let read = |reply: &[u8]| match self.dialect.reply(command, reply, 0) {
                Reply::Done(values) => Some(values),
                _ => None,
            };
            values.extend(instrument.ask(command, &line, read)?);
        }
        Ok(self.operation.result(&values))
    }

    /// Sends all steps once, without waiting for answers.
    ///
    /// # Errors
    /// Returns an error if the port is gone or accepts no data.
    pub(super) fn tell<P: CommandPort>(&self, instrument: &mut Instrument<P>) -> Result<()> {
        for step in &self.operation.steps {
            let line = self.line(instrument, step, &[])?;
            instrument.send(&line)?;
        }
        Ok(())
    }

    /// Returns the line that a step sends, without its terminator.
    fn line<P: CommandPort>(
        &self,
        instrument: &Instrument<P>,
        step: &Step,
        inputs: &[(&str, Value)],
    ) -> Result<Vec<u8>> {
        let args = step.args(inputs)?;
        let mut line = self
            .dialect
            .request(&step.command, &args, 0)
            .map_err(|e| Error::device(format!("{}: {}: {e}", instrument.info(), self.name())))?;
        line.truncate(line.trim_ascii_end().len());
        Ok(line)
    }
}
