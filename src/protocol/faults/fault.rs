//! One fault of a schedule, its conditions, and its occurrences.

use super::kind::{Flaw, Side, What};
use serde::{Deserialize, Serialize};
use toml::Table;

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

impl Fault<Table> {
    /// Parses the kind and its parameters from the fields that not every fault has.
    ///
    /// # Errors
    /// Returns the first parameter that the kind does not have or that is of another type.
    pub(crate) fn read(self) -> Result<Fault, Flaw> {
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
    /// Returns a fault that occurs once: at the `nth` triggered frame or, if its kind counts
    /// messages, at the `nth` message on the control port. `nth` counts from 1.
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
