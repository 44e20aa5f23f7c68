//! The scanner's operations in a dialect described by a file. A scan skips operations that the file
//! does not define.

mod step;

use super::line::{Line, Values};
use super::{Settings, TRIES, agreed, no_words, unquoted};
use crate::CommandPort;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::dialect::{Dialect, Gather, Step, Value};
use phasmid_protocol::printable;
use std::time::Duration;

/// Maximum number of chunks in a long answer.
const MAX_PIECES: u32 = 1 << 16;
/// The settings that determine what a run shows, in the order in which they are queried.
const SETTINGS: [&str; 3] = [SELECTED, "source", MARKED];
const SELECTED: &str = "selected";
/// Whether the device still knows the number (mark) that was last sent to it; it forgets the mark
/// on power-off.
const MARKED: &str = "marked";
/// Whether the device has restarted.
const STARTED: &str = "started anew";

/// A device that speaks a dialect described by a file.
pub(crate) struct Spoken<P> {
    line: Line<P>,
    /// The mark that was last sent to the device.
    mark: u8,
    /// The device had already forgotten its mark when the next one was sent.
    forgotten: bool,
}

impl<P: CommandPort> Spoken<P> {
    pub(super) fn open(port: P, dialect: Dialect, timeout: Duration) -> Result<Self> {
        let mut spoken = Self {
            line: Line::new(port, dialect, timeout),
            mark: 0,
            forgotten: false,
        };
        // Data left in transit by an earlier client is not an answer.
        if spoken.step().is_err() {
            spoken.recover()?;
        }
        Ok(spoken)
    }

    pub(super) fn info(&self) -> &str {
        self.line.info()
    }

    /// Returns the name of the dialect.
    pub(super) fn language(&self) -> &str {
        self.line.dialect().name()
    }

    /// Returns the source of an operation's answer, for messages.
    pub(super) fn place(&self, operation: &str) -> String {
        let steps = self.line.dialect().host().get(operation);
        let command = steps.and_then(|operation| operation.steps.last());
        self.line
            .place(command.map_or(operation, |step| step.command.as_str()))
    }

    fn has(&self, operation: &str) -> bool {
        self.line.dialect().host().get(operation).is_some()
    }

    pub(super) fn recover(&mut self) -> Result<()> {
        self.line.reopen()?;
        if self.line.hush().is_err() {
            self.line.reopen()?;
        }
        self.step()
    }

    /// Performs an operation after synchronizing with the device; `None` if the operation has no
    /// result or the dialect does not define it.
    fn operate(&mut self, operation: &str, inputs: &[(&str, Value)]) -> Result<Option<Value>> {
        self.step()?;
        self.perform(operation, inputs)
    }

    fn perform(&mut self, operation: &str, inputs: &[(&str, Value)]) -> Result<Option<Value>> {
        let Some(operation) = self.line.dialect().host().get(operation).cloned() else {
            return Ok(None);
        };
        let mut values = Values::new();
        for step in &operation.steps {
            values.extend(self.ask(step, inputs)?);
        }
        Ok(operation.result(&values))
    }

    fn ask(&mut self, step: &Step, inputs: &[(&str, Value)]) -> Result<Values> {
        let args = step.args(inputs)?;
        let Some(chunk) = self.line.dialect().chunk(&step.command).cloned() else {
            return self.line.ask(&step.command, &args);
        };
        let place = self.line.place(&step.command);
        let mut read = || {
            let mut last = String::new();
            for _ in 0..TRIES {
                let mut gather = Gather::new(&chunk);
                for _ in 0..MAX_PIECES {
                    let mut args = args.clone();
                    args.retain(|(name, _)| *name != chunk.offset);
                    args.push(gather.ask());
                    match gather.take(&self.line.ask(&step.command, &args)?) {
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

    /// Returns an operation's result; `None` if the dialect does not define it. An answer of
    /// several lines is incomplete if one of them is missing, and is queried again.
    fn value(&mut self, operation: &str) -> Result<Option<Value>> {
        if !self.has(operation) {
            return Ok(None);
        }
        for _ in 0..TRIES {
            if let Some(value) = self.operate(operation, &[])? {
                return Ok(Some(value));
            }
            self.line.hush()?;
        }
        Err(Error::device(format!(
            "{}: the answer is incomplete",
            self.place(operation)
        )))
    }

    /// Returns an operation's result as text without control characters.
    fn word(&mut self, operation: &str) -> Result<Option<String>> {
        let value = self.value(operation)?;
        Ok(value.map(|value| printable(&value.to_string())))
    }

    /// Returns an operation's result once two readings agree.
    fn sure(&mut self, operation: &str) -> Result<Option<String>> {
        if !self.has(operation) {
            return Ok(None);
        }
        agreed(self.place(operation), || self.word(operation))
    }

    pub(super) fn identify(&mut self) -> Result<Option<String>> {
        self.sure("identify")
    }

    pub(super) fn source(&mut self) -> Result<Option<String>> {
        self.sure("source")
    }

    pub(super) fn quiet(&mut self) -> Result<()> {
        self.operate("quiet", &[]).map(drop)
    }

    pub(super) fn restore(&mut self, source: &str) -> Result<()> {
        let source = [("source", Value::from(source))];
        self.operate("restore", &source).map(drop)
    }

    pub(super) fn light_on(&mut self) -> Result<()> {
        self.operate("light_on", &[]).map(drop)
    }

    pub(super) fn select(&mut self, name: &str) -> Result<()> {
        if !self.has("select") {
            return Err(no_words(name, self.language()));
        }
        self.operate("select", &[("name", Value::from(name))])
            .map(drop)
    }

    pub(super) fn list(&mut self) -> Result<Option<Vec<String>>> {
        let list = self.word("list")?;
        Ok(list.map(|list| {
            let names = list.split(',');
            names.map(|name| unquoted(name.trim())).collect()
        }))
    }

    /// Reads the settings back and checks them against what was set.
    pub(super) fn ready(&mut self, sequence: Option<&str>) -> Result<Settings> {
        let mut tries = 1;
        loop {
            let settings = self.settings()?;
            let wrong = settings.0.iter().find(|(what, word)| match what.as_str() {
                SELECTED => sequence.is_some_and(|name| word != name),
                MARKED => word != "true",
                STARTED => word != "false",
                _ => false,
            });
            match wrong {
                None => return Ok(settings),
                Some((what, word)) if tries == TRIES => {
                    return Err(Error::device(format!(
                        "{} says {word:?}, which is not what was set: the device was reset, or \
                         another program controls it",
                        self.place(what)
                    )));
                }
                Some(_) => tries += 1,
            }
        }
    }

    pub(super) fn settings(&mut self) -> Result<Settings> {
        let mut settings = Vec::new();
        for what in SETTINGS {
            if let Some(mut word) = self.word(what)? {
                match what {
                    SELECTED => word = unquoted(&word),
                    MARKED => word = (word == self.mark.to_string()).to_string(),
                    _ => {}
                }
                settings.push((what.to_owned(), word));
            }
        }
        // A power-on message may still be in transit when a run begins, so it proves nothing; a
        // forgotten mark does.
        let started = match self.is_marked() {
            true => self.forgotten,
            false => self.line.booted,
        };
        settings.push((STARTED.to_owned(), started.to_string()));
        Ok(Settings(settings))
    }

    pub(super) fn selected(&self, settings: &Settings) -> Option<String> {
        let (_, name) = settings.0.iter().find(|(what, _)| what == SELECTED)?;
        Some(name.clone())
    }

    fn text(&mut self, operation: &str) -> Result<Option<String>> {
        let place = self.place(operation);
        let not_text = || Error::device(format!("{place}: the answer is not text"));
        let value = self.value(operation)?;
        let text = value.map(|value| value.text().map(str::to_owned).ok_or_else(not_text));
        text.transpose()
    }

    /// Reads a text that contains measurement data: either the dialect's chunk checksum guards it,
    /// or two readings must agree.
    fn document(&mut self, operation: &str) -> Result<Option<String>> {
        let host = self.line.dialect().host().get(operation).cloned();
        let in_pieces = host.is_some_and(|operation| {
            let dialect = self.line.dialect();
            let mut steps = operation.steps.iter();
            steps.any(|step| dialect.chunk(&step.command).is_some())
        });
        match in_pieces {
            true => self.text(operation),
            false => agreed(self.place(operation), || self.text(operation)),
        }
    }

    pub(super) fn manifest(&mut self) -> Result<Option<String>> {
        self.document("manifest")
    }

    pub(super) fn calibration(&mut self) -> Result<Option<String>> {
        self.document("calibration")
    }

    pub(super) fn settle(&mut self) -> Result<()> {
        self.operate("complete", &[]).map(drop)
    }

    pub(super) fn arm(&mut self) -> Result<()> {
        self.operate("arm", &[]).map(drop)
    }

    pub(super) fn trigger(&mut self) -> Result<()> {
        self.step()?;
        let trigger = self.line.dialect().host().get("trigger").cloned();
        for step in trigger.iter().flat_map(|operation| &operation.steps) {
            self.line.send(&step.command, &step.args(&[])?)?;
        }
        Ok(())
    }

    pub(super) fn complaints(&mut self) -> Result<()> {
        match self.word("errors")? {
            Some(words) if !["", "0"].contains(&&words[..]) => Err(Error::device(format!(
                "{} says {words}",
                self.place("errors")
            ))),
            _ => Ok(()),
        }
    }
}
