//! What a scanner needs of a device's control port, in whatever the device speaks: SCPI as an
//! instrument of IEEE 488.2 has it, or a dialect that a file describes.
//!
//! A line may lose, delay, double and damage what it carries, and a device may be switched off and
//! on again between two questions. So what would change the measurement is asked back before and
//! after a run ([`Control::prepare`], [`Control::confirm`]), and what no checksum guards is read
//! until two readings agree.

mod line;
mod scpi;
mod spoken;
#[cfg(test)]
mod tests;

use super::{CommandPort, Instrument};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::dialect::Dialect;
use scpi::Scpi;
use spoken::Spoken;
use std::fmt::Display;
use std::time::Duration;

/// How often a device is looked for again in one scan.
pub(super) const RECOVERIES: u32 = 2;
/// Readings of which two have to agree.
const READINGS: usize = 5;
/// How often settings are asked back that are not as they were ordered.
const TRIES: u32 = 3;

/// A device's control port.
pub(super) enum Control<P> {
    /// SCPI.
    Scpi(Box<Scpi<P>>),
    /// A dialect from a file.
    Spoken(Box<Spoken<P>>),
}

/// Settings as a device says that they are, by what it was asked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Settings(Vec<(String, String)>);

impl Settings {
    /// The first that is not as it was: what was asked, its answer, and the earlier one.
    fn change<'a>(&'a self, before: &'a Self) -> Option<(&'a str, &'a str, &'a str)> {
        let both = self.0.iter().zip(&before.0);
        both.filter(|(now, then)| now != then)
            .map(|(now, then)| (now.0.as_str(), now.1.as_str(), then.1.as_str()))
            .next()
    }
}

/// Reads until two readings agree.
fn agreed<T: PartialEq>(place: impl Display, mut read: impl FnMut() -> Result<T>) -> Result<T> {
    let mut readings = Vec::with_capacity(READINGS);
    while readings.len() < READINGS {
        let reading = read()?;
        if readings.contains(&reading) {
            return Ok(reading);
        }
        readings.push(reading);
    }
    Err(Error::device(format!(
        "{place}: {READINGS} readings, and no two of them agree"
    )))
}

/// A name as it is selected by: dialects that hand on what the device says hand on its quotes.
fn unquoted(name: &str) -> String {
    let inside = name.strip_prefix('"').and_then(|n| n.strip_suffix('"'));
    inside.map_or_else(|| name.to_owned(), |inside| inside.replace("\"\"", "\""))
}

/// A sequence that cannot be selected, for want of words.
fn no_words(name: &str, dialect: &str) -> Error {
    Error::input(
        format!("--sequence {name}"),
        format!("nothing to say it with in dialect {dialect}"),
        "no --sequence: the one that is selected",
    )
}

/// A failure, and what came of looking for the device again.
pub(super) fn both(error: &Error, then: &Error) -> Error {
    Error::device(format!("{error}; then: {then}"))
}

macro_rules! each {
    ($self:ident, $control:ident => $call:expr) => {
        match $self {
            Control::Scpi($control) => $call,
            Control::Spoken($control) => $call,
        }
    };
}

impl<P: CommandPort> Control<P> {
    /// Starts a conversation; `timeout` bounds every wait.
    ///
    /// # Errors
    /// A port that has gone, or one behind which nobody speaks the dialect.
    pub(super) fn open(port: P, dialect: Option<Dialect>, timeout: Duration) -> Result<Self> {
        if let Some(dialect) = &dialect
            && let Some(operation) = dialect.host().needed().next()
        {
            return Err(Error::input(
                format!("dialect {}: [host]", dialect.name()),
                format!("no {operation}, which a scan cannot do without"),
                format!("{operation} = {{ steps = [...] }}"),
            ));
        }
        Ok(match dialect {
            Some(dialect) if !dialect.is_scpi() => {
                Self::Spoken(Box::new(Spoken::open(port, dialect, timeout)?))
            }
            scpi => Self::Scpi(Box::new(Scpi::open(port, scpi, timeout)?)),
        })
    }

    /// The instrument, where the device speaks SCPI.
    pub(super) fn instrument(&mut self) -> Option<&mut Instrument<P>> {
        match self {
            Self::Scpi(scpi) => Some(scpi.instrument()),
            Self::Spoken(_) => None,
        }
    }

    /// Finds a device again that has been silent, out of step, or gone.
    ///
    /// # Errors
    /// A device that does not come back within the timeout.
    pub(super) fn recover(&mut self) -> Result<()> {
        each!(self, control => control.recover())
    }

    /// Does something, and again after a failure, once the device has been found again.
    ///
    /// # Errors
    /// The last failure, and that of a device that was not found.
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

    /// Who the device is: manufacturer, model, serial number, version. Where its dialect has no words
    /// for that, what it speaks.
    ///
    /// # Errors
    /// A device that does not say so.
    pub(super) fn identify(&mut self) -> Result<String> {
        let (idn, question) =
            each!(self, control => (control.identify()?, control.place("identify")));
        let Some(idn) = idn else {
            let spoken = each!(self, control => control.language());
            return Ok(format!("a device that speaks {spoken}"));
        };
        if idn.split(',').count() < 4 {
            return Err(Error::device(format!(
                "{question} was answered with {idn:?}, want manufacturer,model,serial,version"
            )));
        }
        Ok(idn)
    }

    /// The trigger source as it is, where the device says so.
    ///
    /// # Errors
    /// What the port or the device refuses.
    pub(super) fn source(&mut self) -> Result<Option<String>> {
        each!(self, control => control.source())
    }

    /// Makes the device expose nothing but what it is triggered to.
    ///
    /// # Errors
    /// What the port or the device refuses.
    pub(super) fn quiet(&mut self) -> Result<()> {
        each!(self, control => control.quiet())
    }

    /// Leaves the trigger source as it was found.
    ///
    /// # Errors
    /// What the port or the device refuses.
    pub(super) fn restore(&mut self, source: &str) -> Result<()> {
        // It came from the device, but it is not sent back unread.
        if source.is_empty() || !source.chars().all(|c| c.is_ascii_alphanumeric()) {
            return Ok(());
        }
        each!(self, control => control.restore(source))
    }

    /// Makes everything ready for a run of a sequence, the selected one where none is named, and
    /// asks back whether it is so.
    ///
    /// # Errors
    /// What the device refuses, settings that do not stay, and a sequence that it does not have.
    pub(super) fn prepare(&mut self, sequence: Option<&str>) -> Result<Settings> {
        each!(self, control => control.begin())?;
        each!(self, control => control.quiet())?;
        each!(self, control => control.light_on())?;
        if let Some(name) = sequence {
            self.select(name)?;
        }
        each!(self, control => control.ready(sequence))
    }

    /// Name of the selected sequence among settings, as [`Self::prepare`] takes it.
    pub(super) fn selected(&self, settings: &Settings) -> Option<String> {
        each!(self, control => control.selected(settings))
    }

    /// Name of the sequence that is selected now, where the device says so.
    ///
    /// # Errors
    /// What the port or the device refuses.
    pub(super) fn selection(&mut self) -> Result<Option<String>> {
        let settings = each!(self, control => control.settings())?;
        Ok(self.selected(&settings))
    }

    /// Selects a sequence.
    ///
    /// # Errors
    /// What the port or the device refuses, and a sequence that it does not have.
    pub(super) fn select(&mut self, name: &str) -> Result<()> {
        let refused = match each!(self, control => control.select(name)) {
            Ok(()) => return Ok(()),
            Err(error) => error,
        };
        // A name that the device does not have is the user's mistake; anything else is between
        // host and device, and so is a device that does not list its sequences.
        let Ok(Some(names)) = each!(self, control => control.list()) else {
            return Err(refused);
        };
        if names.is_empty() || names.iter().any(|known| known == name) {
            return Err(refused);
        }
        Err(Error::input(
            format!("--sequence {name}"),
            "no sequence of the device",
            names.join(", "),
        ))
    }

    /// The selected sequence's manifest and where it came from; `None` where the device does not
    /// tell.
    ///
    /// # Errors
    /// What the port or the device refuses, and readings that do not agree.
    pub(super) fn manifest(&mut self) -> Result<Option<(String, String)>> {
        let place = each!(self, control => control.place("manifest"));
        let text = each!(self, control => control.manifest())?;
        Ok(text.map(|text| (text, place)))
    }

    /// The device's calibration, as [`Self::manifest`] has it.
    ///
    /// # Errors
    /// As for [`Self::manifest`].
    pub(super) fn calibration(&mut self) -> Result<Option<(String, String)>> {
        let place = each!(self, control => control.place("calibration"));
        let text = each!(self, control => control.calibration())?;
        Ok(text.map(|text| (text, place)))
    }

    /// Waits until the last frame of an earlier run has left the device, where it says so.
    ///
    /// # Errors
    /// What the port or the device refuses.
    pub(super) fn settle(&mut self) -> Result<()> {
        each!(self, control => control.settle())
    }

    /// Arms the device at the first pattern, whatever it was doing.
    ///
    /// # Errors
    /// What the port or the device refuses.
    pub(super) fn arm(&mut self) -> Result<()> {
        each!(self, control => control.arm())
    }

    /// Triggers, once: frames say whether that has come through.
    ///
    /// # Errors
    /// What the port or the device refuses.
    pub(super) fn trigger(&mut self) -> Result<()> {
        each!(self, control => control.trigger())
    }

    /// Asks after a run whether the device has anything to complain of.
    ///
    /// # Errors
    /// Its complaints.
    pub(super) fn complaints(&mut self) -> Result<()> {
        each!(self, control => control.complaints())
    }

    /// Asks after a run whether everything is still as it was before: a device that has been
    /// switched off and on, or that somebody else has given orders, has not shown what it was told.
    ///
    /// # Errors
    /// What has changed.
    pub(super) fn confirm(&mut self, before: &Settings) -> Result<()> {
        let mut tries = 1;
        loop {
            let now = each!(self, control => control.settings())?;
            let Some((what, word, earlier)) = now.change(before) else {
                return Ok(());
            };
            // A damaged answer is another one the next time; events are told once.
            if tries == TRIES || what == scpi::EVENTS {
                let place = each!(self, control => control.info());
                return Err(Error::device(format!(
                    "{place}: {what} says {word:?} after the run and said {earlier:?} before it: the \
                     device was reset, or somebody else gives it orders"
                )));
            }
            tries += 1;
        }
    }
}
