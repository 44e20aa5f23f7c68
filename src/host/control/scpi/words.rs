//! With which words an operation is done: the device's own, which the file `scpi` has, or those of a
//! file that says others.

use crate::{CommandPort, Instrument};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::dialect::{Dialect, Operation, Reply, Step, Value};

/// The words of a conversation.
pub(super) struct Words {
    /// The device's own.
    own: Dialect,
    file: Option<Dialect>,
}

/// How an operation is done.
pub(super) enum Wording<'a> {
    /// As the device's own words have it.
    Own,
    /// As a file has it.
    File(Worded<'a>),
    /// A file has no words for it: a scan does without.
    None,
}

/// An operation in a file's words.
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

    /// What the device says of its own accord at power-on. It is skipped; that the device was switched
    /// off it says when it is asked (`*ESR?`), for this may be on its way when a run begins.
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
    /// What messages call it: its last command.
    pub(super) fn name(&self) -> String {
        let step = self.operation.steps.last();
        let command = step.map_or("", |step| step.command.as_str());
        format!("{command} ({})", self.dialect.name())
    }

    /// Does all steps; gives the result where it has one.
    ///
    /// # Errors
    /// What the port or the device refuses, and what the words cannot say.
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

    /// Sends all steps once, without waiting for anything.
    ///
    /// # Errors
    /// A port that has gone or takes nothing.
    pub(super) fn tell<P: CommandPort>(&self, instrument: &mut Instrument<P>) -> Result<()> {
        for step in &self.operation.steps {
            let line = self.line(instrument, step, &[])?;
            instrument.send(&line)?;
        }
        Ok(())
    }

    /// What a step says, without its end.
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
