//! Fault schedules: which faults a device injects, and when. The same file reproduces the same
//! faults.
//!
//! ```toml
//! seed = 7                     # of all random choices; 0 when absent
//!
//! [[fault]]                    # the third frame of a sequence is torn, once
//! what = "torn"
//! when = { nth = 3 }
//!
//! [[fault]]                    # one in fifty replies is 300 ms late in the first minute
//! what = "late-reply"
//! by_ms = 300
//! when = { probability = 0.02, window_s = [0, 60] }
//!
//! [[fault]]                    # the device boots while the second sequence is being exposed
//! what = "reset"
//! on = "camera"
//! when = { command = "*TRG", nth = 40 }
//! times = 1
//! ```
//!
//! Conditions of `when` are evaluated in order, and all must hold: `device`, `frames`, `command`
//! and `window_s` select the frames or messages to count; `nth` and `every` apply to that count;
//! `probability` applies to the remainder; `times` limits the number of occurrences.

mod check;
mod kind;
#[cfg(test)]
mod tests;

pub use check::Flaw;
pub use kind::{Kind, Parameter, Side, What};

use phasmid_core::error::Result;
use phasmid_core::source::TomlSource;
use serde::{Deserialize, Serialize};
use std::path::Path;
use toml::Table;

/// Maximum number of faults in a schedule, including those added at run time.
pub const MAX_FAULTS: usize = 1024;

/// A schedule: the file of `phasmid serve --faults`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "schema", schemars(rename = "Schedule"))]
#[serde(deny_unknown_fields, bound(deserialize = "W: Deserialize<'de>"))]
pub struct Schedule<W = What> {
    /// Seed of all random choices.
    #[serde(default)]
    pub seed: u64,
    /// Faults. If two affect the same frame or message, the earlier one acts first.
    #[serde(default)]
    pub fault: Vec<Fault<W>>,
}

/// One fault, as written in a schedule or sent over the service channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "schema", schemars(rename = "Fault", deny_unknown_fields))]
pub struct Fault<W = What> {
    /// Kind and parameters.
    #[serde(flatten)]
    pub what: W,
    /// Whether frames or messages are counted. Only `disconnect` and `reset` allow a choice; for
    /// all other kinds it can only be the implied value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub on: Option<Side>,
    /// Name of the device if one `serve` has several; all devices when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device: Option<String>,
    /// When it occurs; always when absent.
    #[serde(default, skip_serializing_if = "When::is_always")]
    pub when: When,
    /// Maximum number of occurrences; unlimited when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub times: Option<u64>,
}

/// Conditions, all of which must hold.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct When {
    /// Index of the counted frame or message, from 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nth: Option<u64>,
    /// Every nth counted frame or message; with `nth`, starting at that one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub every: Option<u64>,
    /// Device time window in seconds, excluding its end.
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "phasmid_core::numbers::exactly_if_any"
    )]
    pub window_s: Option<[f64; 2]>,
    /// Text that the command must contain, ignoring case. For a message, the command is the message
    /// itself or the one that it answers; for a frame, the last command before it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command: Option<String>,
    /// Probability, 0 to 1, drawn from the schedule's seed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probability: Option<f64>,
    /// Frames to count; those of triggered exposures when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<Frames>,
}

/// Frames to count.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Frames {
    /// Frames of triggered exposures.
    #[default]
    Triggered,
    /// Frames of a free-running camera.
    Free,
    /// All frames.
    All,
}

/// Direction of bytes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// From the client to the device.
    ToDevice,
    /// From the device to the client.
    #[default]
    ToHost,
}

/// A fault that has occurred.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Struck {
    /// Device time in nanoseconds.
    pub time_ns: u64,
    /// Id of the fault. Faults of a schedule are numbered from 1; faults added later continue the
    /// numbering.
    pub fault: u64,
    /// Name of the kind of fault.
    pub what: String,
    /// The affected frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame: Option<u64>,
    /// The affected command, or the command whose answer is affected.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command: Option<String>,
}

impl Default for Schedule {
    fn default() -> Self {
        Self {
            seed: 0,
            fault: Vec::new(),
        }
    }
}

impl Schedule {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read or if [`Self::from_source`] fails.
    pub fn read(path: &Path) -> Result<Self> {
        Self::from_source(&TomlSource::read(path)?)
    }

    /// Reads and checks a file for devices of the given names.
    ///
    /// # Errors
    /// Returns an error if [`Self::read`] fails or if a fault names a device that is not among
    /// them.
    pub fn read_for(path: &Path, devices: &[&str]) -> Result<Self> {
        let source = TomlSource::read(path)?;
        let schedule = Self::from_source(&source)?;
        check::devices(&schedule, devices, &source)?;
        Ok(schedule)
    }

    /// Reads and checks a document.
    ///
    /// # Errors
    /// Returns an error with its line on a syntax error, an unknown field, a parameter that the
    /// fault does not have, or a value out of range.
    pub fn from_source(source: &TomlSource) -> Result<Self> {
        check::schedule(source.deserialize()?, source)
    }
}

impl Fault<Table> {
    /// Reads what goes wrong from the fields that all faults do not have.
    ///
    /// # Errors
    /// Returns the first parameter that the kind does not have or that is of another type.
    pub(crate) fn read(self) -> std::result::Result<Fault, Flaw> {
        Ok(Fault {
            what: What::read(self.what)?,
            on: self.on,
            device: self.device,
            when: self.when,
            times: self.times,
        })
    }
}

impl Fault {
    /// Returns a fault that occurs once: at the `nth` triggered frame, or at the `nth` message on the
    /// control port if the kind concerns those, counted from 1.
    pub fn once(what: What, nth: u64) -> Self {
        let when = When {
            nth: Some(nth),
            ..When::default()
        };
        Self {
            when,
            times: Some(1),
            ..Self::new(what)
        }
    }

    /// Returns a fault without conditions.
    pub fn new(what: What) -> Self {
        Self {
            what,
            on: None,
            device: None,
            when: When::default(),
            times: None,
        }
    }

    /// Returns whether frames or messages are counted.
    pub fn side(&self) -> Side {
        self.on.unwrap_or(self.what.kind().sides[0])
    }

    /// Returns whether the fault applies to a device of this name.
    pub fn concerns(&self, device: &str) -> bool {
        self.device.as_deref().is_none_or(|name| name == device)
    }
}

impl When {
    /// Returns whether there are no conditions.
    pub fn is_always(&self) -> bool {
        *self == Self::default()
    }
}
