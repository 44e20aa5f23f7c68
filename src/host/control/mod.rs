//! The operations that a scanner needs of a device's control port, in the language that the device
//! speaks: SCPI over IEEE 488.2, or a dialect described by a file.
//!
//! A line may lose, delay, duplicate and corrupt data, and a device may be power-cycled between two
//! queries. Therefore every setting that affects the measurement is read back before and after a
//! run ([`Control::prepare`], [`Control::confirm`]), and data without a checksum is read until two
//! readings agree.

mod line;
mod scpi;
mod spoken;
#[cfg(test)]
mod tests;

use super::{CommandPort, Instrument};
use phasmid_core::error::{Error, Result};
use phasmid_core::wording::did_you_mean;
use phasmid_protocol::dialect::Dialect;
use scpi::Scpi;
use spoken::Spoken;
use std::fmt::Display;
use std::time::Duration;

/// Number of times that a lost device is searched for in one scan.
pub(super) const RECOVERIES: u32 = 2;
/// Maximum number of readings, two of which must agree.
const READINGS: usize = 5;
/// Number of times that settings are read back if they differ from what was set.
const TRIES: u32 = 3;

/// The control port of a device.
pub(super) enum Control<P> {
    /// SCPI.
    Scpi(Box<Scpi<P>>),
    /// A dialect from a file.
    Spoken(Box<Spoken<P>>),
}

/// The device's settings as it reports them: pairs of query and answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Settings(Vec<(String, String)>);

impl Settings {
    /// Returns the first setting that has changed: the query, the answer now, and the earlier
    /// answer.
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
        "{place}: {READINGS} readings, no two of which agree"
    )))
}

/// Strips the quotes from a sequence name, giving the form used to select it: a dialect may pass on
/// a name with the device's quotes.
fn unquoted(name: &str) -> String {
    let inside = name.strip_prefix('"').and_then(|n| n.strip_suffix('"'));
    inside.map_or_else(|| name.to_owned(), |inside| inside.replace("\"\"", "\""))
}

/// Error for a sequence that cannot be selected because the dialect has no command for it.
fn no_words(name: &str, dialect: &str) -> Error {
    Error::input(
        format!("--sequence {name}"),
        format!("dialect {dialect} cannot select a sequence"),
        "no --sequence, to use the selected one",
    )
}

/// Combines a failure with the error of the subsequent search for the device.
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
    /// Opens the conversation; `timeout` bounds every wait.
    ///
    /// # Errors
    /// Returns an error if the port is gone, or if no device on it speaks the dialect.
    pub(super) fn open(port: P, dialect: Option<Dialect>, timeout: Duration) -> Result<Self> {
        if let Some(dialect) = &dialect
            && let Some(operation) = dialect.host().needed().next()
        {
            return Err(Error::input(
                format!("dialect {}: [host]", dialect.name()),
                format!("no {operation}, which a scan needs"),
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

    /// Returns the instrument if the device speaks SCPI.
    pub(super) fn instrument(&mut self) -> Option<&mut Instrument<P>> {
        match self {
            Self::Scpi(scpi) => Some(scpi.instrument()),
            Self::Spoken(_) => None,
        }
    }

    /// Restores contact with a device that was silent, out of step, or gone.
    ///
    /// # Errors
    /// Returns an error if the device does not come back within the timeout.
    pub(super) fn recover(&mut self) -> Result<()> {
        each!(self, control => control.recover())
    }

    /// Performs an action, and repeats it after a failure once contact with the device is restored.
    ///
    /// # Errors
    /// Returns the last failure, together with the error of the recovery if that failed.
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

    /// Returns the device's identity: manufacturer, model, serial number, version. If its dialect
    /// has no command for that, returns the name of the dialect.
    ///
    /// Returns an error if the device does not identify itself.
    pub(super) fn identify(&mut self) -> Result<String> {
        let (idn, question) =
            each!(self, control => (control.identify()?, control.place("identify")));
        let Some(idn) = idn else {
            let spoken = each!(self, control => control.language());
            return Ok(format!("a device that speaks {spoken}"));
        };
        if idn.split(',').count() < 4 {
            return Err(Error::device(format!(
                "{question} was answered with {idn:?}, expected manufacturer,model,serial,version"
            )));
        }
        Ok(idn)
    }

    /// Returns the current trigger source, if the device reports it.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    pub(super) fn source(&mut self) -> Result<Option<String>> {
        each!(self, control => control.source())
    }

    /// Makes the device expose only when it is triggered.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    pub(super) fn quiet(&mut self) -> Result<()> {
        each!(self, control => control.quiet())
    }

    /// Restores the trigger source that was found.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    pub(super) fn restore(&mut self, source: &str) -> Result<()> {
        // The text came from the device; check it before sending it back.
        if source.is_empty() || !source.chars().all(|c| c.is_ascii_alphanumeric()) {
            return Ok(());
        }
        each!(self, control => control.restore(source))
    }

    /// Prepares a run of a sequence (of the selected one if `sequence` is `None`), and reads the
    /// settings back.
    ///
    /// # Errors
    /// Returns an error if the device refuses, does not keep a setting, or does not have the
    /// sequence.
    pub(super) fn prepare(&mut self, sequence: Option<&str>) -> Result<Settings> {
        each!(self, control => control.begin())?;
        each!(self, control => control.quiet())?;
        each!(self, control => control.light_on())?;
        if let Some(name) = sequence {
            self.select(name)?;
        }
        each!(self, control => control.ready(sequence))
    }

    /// Returns the name of the selected sequence from settings, in the form that [`Self::prepare`]
    /// takes.
    pub(super) fn selected(&self, settings: &Settings) -> Option<String> {
        each!(self, control => control.selected(settings))
    }

    /// Returns the name of the currently selected sequence, if the device reports it.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    pub(super) fn selection(&mut self) -> Result<Option<String>> {
        let settings = each!(self, control => control.settings())?;
        Ok(self.selected(&settings))
    }

    /// Selects a sequence.
    ///
    /// # Errors
    /// Returns an error if the port fails, the device refuses, or it does not have the sequence.
    pub(super) fn select(&mut self, name: &str) -> Result<()> {
        let refused = match each!(self, control => control.select(name)) {
            Ok(()) => return Ok(()),
            Err(error) => error,
        };
        // A name that the device does not have is the user's mistake. Any other failure, including
        // that the device does not list its sequences, is a fault between host and device.
        let Ok(Some(names)) = each!(self, control => control.list()) else {
            return Err(refused);
        };
        if names.is_empty() || names.iter().any(|known| known == name) {
            return Err(refused);
        }
        let hint = did_you_mean(name, names.iter().map(String::as_str));
        Err(Error::input(
            format!("--sequence {name}"),
            format!("not a sequence of the device{hint}"),
            names.join(", "),
        ))
    }

    /// Reads the selected sequence's manifest and where it came from; `None` if the device does not
    /// provide it.
    ///
    /// # Errors
    /// Returns an error if the port fails, the device refuses, or the readings do not agree.
    pub(super) fn manifest(&mut self) -> Result<Option<(String, String)>> {
        let place = each!(self, control => control.place("manifest"));
        let text = each!(self, control => control.manifest())?;
        Ok(text.map(|text| (text, place)))
    }

    /// Reads the device's calibration, in the same form as [`Self::manifest`].
    ///
    /// # Errors
    /// Same as [`Self::manifest`].
    pub(super) fn calibration(&mut self) -> Result<Option<(String, String)>> {
        let place = each!(self, control => control.place("calibration"));
        let text = each!(self, control => control.calibration())?;
        Ok(text.map(|text| (text, place)))
    }

    /// Waits until the last frame of an earlier run has left the device, if the device can report
    /// that.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    pub(super) fn settle(&mut self) -> Result<()> {
        each!(self, control => control.settle())
    }

    /// Arms the device at the first pattern, whatever its state.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    pub(super) fn arm(&mut self) -> Result<()> {
        each!(self, control => control.arm())
    }

    /// Triggers once, without confirmation: the frames show whether the trigger arrived.
    ///
    /// # Errors
    /// Returns an error if the port fails or the device refuses.
    pub(super) fn trigger(&mut self) -> Result<()> {
        each!(self, control => control.trigger())
    }

    /// Reads the device's errors after a run.
    ///
    /// # Errors
    /// Returns the errors that the device reports.
    pub(super) fn complaints(&mut self) -> Result<()> {
        each!(self, control => control.complaints())
    }

    /// Checks after a run that all settings are unchanged. A device that was power-cycled or
    /// reconfigured by someone else meanwhile may not have shown what it was set to show.
    ///
    /// # Errors
    /// Returns an error that names the setting that has changed.
    pub(super) fn confirm(&mut self, before: &Settings) -> Result<()> {
        let mut tries = 1;
        loop {
            let now = each!(self, control => control.settings())?;
            let Some((what, word, earlier)) = now.change(before) else {
                return Ok(());
            };
            // A corrupted answer differs the next time, so ask again; events are reported only
            // once.
            if tries == TRIES || what == scpi::EVENTS {
                let place = each!(self, control => control.info());
                return Err(Error::device(format!(
                    "{place}: {what} says {word:?} after the run and said {earlier:?} before it: \
                     the device was reset, or another program controls it"
                )));
            }
            tries += 1;
        }
    }
}
