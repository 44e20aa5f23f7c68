//! The operations that a scanner performs on a device's control port, in the language that the
//! device speaks: SCPI over IEEE 488.2, or a dialect described by a file.
//!
//! A line may lose, delay, duplicate and corrupt data, and a device may be power-cycled between two
//! queries. Therefore every setting that affects the measurement is read back before and after a
//! run ([`Control::prepare`], [`Control::confirm`]), and data without a checksum is read until two
//! readings agree.

mod conversation;
mod line;
mod marked;
mod scpi;
#[cfg(test)]
mod tests;

use super::{CommandPort, Instrument};
use conversation::{Conversation, TRIES, Values, agreed};
use marked::Marked;
use phasmid_core::error::{Error, Result};
use phasmid_core::wording::did_you_mean;
use phasmid_protocol::dialect::{Dialect, Operation, Value};
use phasmid_protocol::printable;
use scpi::Scpi;
use std::sync::Arc;
use std::time::Duration;

/// Maximum number of times that a lost device is searched for in one scan.
pub(super) const RECOVERIES: u32 = 2;
/// Name of the operation that reports the selected sequence.
const SELECTED: &str = "selected";

/// The control port of a device.
pub(super) struct Control<P> {
    dialect: Arc<Dialect>,
    talk: Talk<P>,
}

/// The conversation, chosen by the framing of the dialect.
enum Talk<P> {
    Scpi(Box<Scpi<P>>),
    Marked(Box<Marked<P>>),
}

/// The device's settings as it reports them: pairs of the setting's name in the dialect and the
/// answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Settings(Vec<(String, String)>);

impl Settings {
    /// Returns the first setting that has changed: its name, the current answer (empty if the
    /// device no longer reports the setting), and the earlier answer.
    fn change<'a>(&'a self, before: &'a Self) -> Option<(&'a str, &'a str, &'a str)> {
        before.0.iter().find_map(|(what, then)| {
            let now = self.0.iter().find(|(name, _)| name == what);
            let now = now.map_or("", |(_, word)| word);
            (now != then).then_some((what.as_str(), now, then.as_str()))
        })
    }
}

/// Strips the quotes from a sequence name, because a dialect may pass on a name with the device's
/// quotes. The result is the form with which the sequence is selected.
fn unquoted(name: &str) -> String {
    let inside = name.strip_prefix('"').and_then(|n| n.strip_suffix('"'));
    inside.map_or_else(|| name.to_owned(), |inside| inside.replace("\"\"", "\""))
}

/// Splits a comma-separated list into names; a quoted name may contain commas and doubled quotes.
fn names(list: &str) -> Vec<String> {
    let mut quoted = false;
    let items = list.split(|c| {
        quoted ^= c == '"';
        c == ',' && !quoted
    });
    let name = |item: &str| {
        let item = item.trim();
        let inner = item
            .strip_prefix('"')
            .and_then(|rest| rest.strip_suffix('"'));
        inner.map_or_else(|| item.to_owned(), |inner| inner.replace("\"\"", "\""))
    };
    items.map(name).collect()
}

/// Combines an error with the error `then` of the subsequent search for the device.
pub(super) fn both(error: &Error, then: &Error) -> Error {
    Error::device(format!("{error}; then: {then}"))
}

impl<P: CommandPort> Control<P> {
    /// Opens the conversation, in SCPI if `dialect` is `None`; `timeout` bounds every wait.
    ///
    /// # Errors
    /// Returns an error if the port is gone, or if no device on it speaks the dialect.
    pub(super) fn open(port: P, dialect: Option<Dialect>, timeout: Duration) -> Result<Self> {
        let dialect = Arc::new(match dialect {
            Some(dialect) => dialect,
            None => Dialect::load("scpi")?,
        });
        if let Some(operation) = dialect.host().needed().next() {
            return Err(Error::input(
                format!("dialect {}: [host]", dialect.name()),
                format!("no {operation}, which a scan needs"),
                format!("{operation} = {{ steps = [...] }}"),
            ));
        }
        let talk = match dialect.is_scpi() {
            true => Talk::Scpi(Box::new(Scpi::open(port, dialect.clone(), timeout)?)),
            false => Talk::Marked(Box::new(Marked::open(port, dialect.clone(), timeout)?)),
        };
        Ok(Self { dialect, talk })
    }

    fn talk(&mut self) -> &mut (dyn Conversation + '_) {
        match &mut self.talk {
            Talk::Scpi(scpi) => &mut **scpi,
            Talk::Marked(marked) => &mut **marked,
        }
    }

    /// Returns the instrument if the device speaks SCPI.
    pub(super) fn instrument(&mut self) -> Option<&mut Instrument<P>> {
        match &mut self.talk {
            Talk::Scpi(scpi) => Some(scpi.instrument()),
            Talk::Marked(_) => None,
        }
    }

    /// Restores contact with a device that was silent, out of step, or gone.
    ///
    /// # Errors
    /// Returns an error if the device does not come back within the timeout.
    pub(super) fn recover(&mut self) -> Result<()> {
        self.talk().recover()
    }

    /// Performs an action, and repeats it after a failure once contact with the device is restored.
    ///
    /// # Errors
    /// Returns the last error of the action, together with the error of the recovery if the
    /// recovery failed.
    pub(super) fn persist<T>(&mut self, mut act: impl FnMut(&mut Self) -> Result<T>) -> Result<T> {
        let mut left = RECOVERIES;
        loop {
            match act(self) {
                Err(error) if left > 0 && !matches!(error, Error::Input { .. }) => {
                    left -= 1;
                    self.recover().map_err(|then| both(&error, &then))?;
                }
                done => return done,
            }
        }
    }

    /// Returns a description of the port and of the last command of `what`, for messages; `what` is
    /// an operation or a setting.
    fn place(&mut self, what: &str) -> String {
        let dialect = self.dialect.clone();
        let host = dialect.host();
        let steps = host.get(what).or_else(|| host.setting(what));
        let last = steps.and_then(|operation| operation.steps.last());
        self.talk().place(last.map_or(what, |step| &step.command))
    }

    /// Performs the steps of an operation; `None` if the device does not know one of them.
    fn steps(&mut self, operation: &Operation, inputs: &[(&str, Value)]) -> Result<Option<Values>> {
        let mut values = Values::new();
        for step in &operation.steps {
            match self.talk().ask(&step.command, &step.args(inputs)?)? {
                Some(more) => values.extend(more),
                None => return Ok(None),
            }
        }
        Ok(Some(values))
    }

    /// Performs an operation without a result; does nothing if the dialect does not define it.
    fn order(&mut self, operation: &str, inputs: &[(&str, Value)]) -> Result<()> {
        match self.dialect.clone().host().get(operation) {
            Some(operation) => self.steps(operation, inputs).map(drop),
            None => Ok(()),
        }
    }

    /// Returns an operation's result; `None` if the dialect does not define it, or the device does
    /// not know it. An answer of several lines is incomplete if one of them is missing, and is
    /// queried again.
    fn result(&mut self, operation: &Operation) -> Result<Option<Value>> {
        for _ in 0..TRIES {
            let Some(values) = self.steps(operation, &[])? else {
                return Ok(None);
            };
            if let Some(value) = operation.result(&values) {
                return Ok(Some(value));
            }
            self.talk().hush()?;
        }
        let last = operation.steps.last();
        let place = self.talk().place(last.map_or("", |step| &step.command));
        Err(Error::device(format!("{place}: the answer is incomplete")))
    }

    fn value(&mut self, operation: &str) -> Result<Option<Value>> {
        match self.dialect.clone().host().get(operation) {
            Some(operation) => self.result(operation),
            None => Ok(None),
        }
    }

    /// Returns an operation's result as text without control characters.
    fn word(&mut self, operation: &str) -> Result<Option<String>> {
        let value = self.value(operation)?;
        Ok(value.map(|value| printable(&value.to_string())))
    }

    /// Returns an operation's result once two readings agree.
    fn sure(&mut self, operation: &str) -> Result<Option<String>> {
        let place = self.place(operation);
        agreed(place, || self.word(operation))
    }

    /// Returns the device's identity: manufacturer, model, serial number, version. If the dialect
    /// has no command that queries the identity, returns the name of the dialect.
    ///
    /// Returns an error if the device does not identify itself.
    pub(super) fn identify(&mut self) -> Result<String> {
        let Some(idn) = self.sure("identify")? else {
            return Ok(format!("a device that speaks {}", self.language()));
        };
        if idn.split(',').count() < 4 {
            let question = self.place("identify");
            return Err(Error::device(format!(
                "{question} was answered with {idn:?}, expected manufacturer,model,serial,version"
            )));
        }
        Ok(idn)
    }

    fn language(&self) -> &str {
        match self.dialect.name() {
            "scpi" => "SCPI",
            name => name,
        }
    }

    /// Returns the current trigger source, if the device reports it.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    pub(super) fn source(&mut self) -> Result<Option<String>> {
        self.sure("source")
    }

    /// Makes the device expose only when it is triggered.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    pub(super) fn quiet(&mut self) -> Result<()> {
        self.order("quiet", &[])
    }

    /// Sets the trigger source back to `source`, the answer of [`Self::source`] before the first
    /// scan.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    pub(super) fn restore(&mut self, source: &str) -> Result<()> {
        // The text came from the device; check it before sending it back.
        if source.is_empty() || !source.chars().all(|c| c.is_ascii_alphanumeric()) {
            return Ok(());
        }
        self.order("restore", &[("source", Value::from(source))])
    }

    /// Prepares a run of a sequence (of the selected one if `sequence` is `None`), and reads the
    /// settings back.
    ///
    /// # Errors
    /// Returns an error if the device refuses, does not keep a setting, or does not have the
    /// sequence.
    pub(super) fn prepare(&mut self, sequence: Option<&str>) -> Result<Settings> {
        self.talk().begin()?;
        self.quiet()?;
        self.order("light_on", &[])?;
        if let Some(name) = sequence {
            self.select(name)?;
        }
        self.ready(sequence)
    }

    /// Reads the settings back and checks that the device has kept the values that were set.
    fn ready(&mut self, sequence: Option<&str>) -> Result<Settings> {
        let mut tries = 1;
        loop {
            let settings = self.settings()?;
            let dialect = self.dialect.clone();
            let wrong = settings.0.iter().find(|(what, word)| match sequence {
                Some(name) if what == SELECTED => word != name,
                _ => !dialect.host().allows(what, word),
            });
            match wrong {
                None if self.talk().restarted()? => return Err(self.reset()),
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

    fn reset(&mut self) -> Error {
        let info = self.talk().info();
        Error::device(format!(
            "{info}: the device was reset, or another program controls it"
        ))
    }

    /// Queries the settings that the device reports: the sequence, the trigger source, and the
    /// settings in the table `settings` of the dialect's file.
    fn settings(&mut self) -> Result<Settings> {
        let mut settings = Vec::new();
        for (name, operation) in self.dialect.clone().host().settings() {
            if let Some(value) = self.result(operation)? {
                let word = printable(&value.to_string());
                let word = if name == SELECTED {
                    unquoted(&word)
                } else {
                    word
                };
                settings.push((name.to_owned(), word));
            }
        }
        Ok(Settings(settings))
    }

    /// Returns the name of the selected sequence from settings, in the form that [`Self::prepare`]
    /// takes.
    pub(super) fn selected(&self, settings: &Settings) -> Option<String> {
        let (_, name) = settings.0.iter().find(|(what, _)| what == SELECTED)?;
        Some(name.clone())
    }

    /// Returns the name of the currently selected sequence, if the device reports it.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    pub(super) fn selection(&mut self) -> Result<Option<String>> {
        Ok(self.word(SELECTED)?.map(|name| unquoted(&name)))
    }

    /// Selects a sequence.
    ///
    /// # Errors
    /// Returns an error if the port fails, the device refuses, or it does not have the sequence.
    pub(super) fn select(&mut self, name: &str) -> Result<()> {
        let place = || format!("--sequence {name}");
        if self.dialect.host().get("select").is_none() {
            return Err(Error::input(
                place(),
                format!("dialect {} cannot select a sequence", self.language()),
                "no --sequence, to use the selected one",
            ));
        }
        let refused = match self.order("select", &[("name", Value::from(name))]) {
            Ok(()) => return Ok(()),
            Err(error) => error,
        };
        // If the device lacks a sequence with this name, that is the user's mistake. Any other
        // failure, including that the device cannot list its sequences, is a fault between host and
        // device.
        let Ok(Some(list)) = self.word("list") else {
            return Err(refused);
        };
        let names = names(&list);
        if names.is_empty() || names.iter().any(|known| known == name) {
            return Err(refused);
        }
        let hint = did_you_mean(name, names.iter().map(String::as_str));
        Err(Error::input(
            place(),
            format!("not a sequence of the device{hint}"),
            names.join(", "),
        ))
    }

    /// Reads the selected sequence's manifest. Returns the manifest and its origin for messages;
    /// `None` if the device does not provide a manifest.
    ///
    /// # Errors
    /// Returns an error if the port fails, the device refuses, or the readings do not agree.
    pub(super) fn manifest(&mut self) -> Result<Option<(String, String)>> {
        self.document("manifest")
    }

    /// Reads the device's calibration, in the same form as [`Self::manifest`].
    ///
    /// # Errors
    /// Same as [`Self::manifest`].
    pub(super) fn calibration(&mut self) -> Result<Option<(String, String)>> {
        self.document("calibration")
    }

    /// Reads a text that contains measurement data, in which a number with one wrong digit is still
    /// a number: either the dialect's chunk checksum guards it, or two readings must agree.
    fn document(&mut self, operation: &str) -> Result<Option<(String, String)>> {
        let place = self.place(operation);
        let dialect = self.dialect.clone();
        let mut steps = dialect.host().get(operation).map(|o| o.steps.iter());
        let in_pieces = steps
            .as_mut()
            .is_some_and(|steps| steps.any(|step| dialect.chunk(&step.command).is_some()));
        let value = match in_pieces {
            true => self.value(operation)?,
            false => agreed(&place, || self.value(operation))?,
        };
        let Some(value) = value else {
            return Ok(None);
        };
        match value.text() {
            Some(text) => Ok(Some((text.to_owned(), place))),
            None => Err(Error::device(format!("{place}: the answer is not UTF-8"))),
        }
    }

    /// Waits until the device reports that the last frame of an earlier run has left it; does
    /// nothing if the device cannot report this.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    pub(super) fn settle(&mut self) -> Result<()> {
        self.order("complete", &[])
    }

    /// Arms the device at the first pattern, whatever state the device is in.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    pub(super) fn arm(&mut self) -> Result<()> {
        self.order("arm", &[])
    }

    /// Sends one trigger and does not wait for a reply: the frames show whether the trigger
    /// arrived.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    pub(super) fn trigger(&mut self) -> Result<()> {
        let dialect = self.dialect.clone();
        let trigger = dialect.host().get("trigger");
        for step in trigger.iter().flat_map(|operation| &operation.steps) {
            self.talk().send(&step.command, &step.args(&[])?)?;
        }
        Ok(())
    }

    /// Reads the device's errors after a run.
    ///
    /// # Errors
    /// Returns the errors that the device reports.
    pub(super) fn complaints(&mut self) -> Result<()> {
        if let Talk::Scpi(scpi) = &mut self.talk {
            return scpi.complaints();
        }
        match self.word("errors")? {
            Some(words) if !["", "0"].contains(&&words[..]) => Err(Error::device(format!(
                "{} says {words}",
                self.place("errors")
            ))),
            _ => Ok(()),
        }
    }

    /// Checks after a run that all settings are unchanged. If the device was power-cycled or
    /// reconfigured by another program during the run, it may have projected the wrong patterns.
    ///
    /// # Errors
    /// Returns an error that names the setting that has changed.
    pub(super) fn confirm(&mut self, before: &Settings) -> Result<()> {
        let mut tries = 1;
        loop {
            let now = self.settings()?;
            match now.change(before) {
                None if self.talk().restarted()? => return Err(self.reset()),
                None => return Ok(()),
                // The answer may have been corrupted in transit; then the next answer differs, so
                // ask again.
                Some((what, word, earlier)) if tries == TRIES => {
                    return Err(Error::device(format!(
                        "{} says {word:?} after the run and said {earlier:?} before it: the \
                         device was reset, or another program controls it",
                        self.place(what)
                    )));
                }
                Some(_) => tries += 1,
            }
        }
    }
}
