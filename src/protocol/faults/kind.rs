//! Kinds of faults and their properties.

use serde::{Deserialize, Serialize};

/// Kinds of faults.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum What {
    /// A frame that never arrives.
    Dropped,
    /// A frame that arrives twice.
    Repeated,
    /// A frame that arrives late and delays those after it.
    Late,
    /// A frame that arrives after the next one.
    Swapped,
    /// A frame that ends with rows of the previous frame.
    Torn,
    /// A frame that has lost rows.
    RowsMissing,
    /// Flipped bits in a frame.
    BitsFlipped,
    /// A frame without the projector's light.
    Dark,
    /// A frame of another pattern of the sequence.
    WrongPattern,
    /// A frame with the projector's light on for only part of its exposure.
    PartialExposure,
    /// A reply that never arrives.
    NoReply,
    /// A reply that arrives late and delays those after it.
    LateReply,
    /// A reply that arrives twice.
    ReplyTwice,
    /// Spurious bytes before a reply.
    GarbageBefore,
    /// Spurious bytes inside a reply.
    GarbageInside,
    /// Flipped bits on the line.
    BitErrors,
    /// A command that the device refuses for now.
    Nak,
    /// A port that disappears and returns.
    Disconnect,
    /// A device that restarts.
    Reset,
}

/// Unit that a fault's conditions count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Frames.
    Camera,
    /// Messages on the control port.
    Port,
}

/// A parameter of a fault.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Name of its field.
    pub name: &'static str,
    /// Default value, as text.
    pub default: &'static str,
    /// Allowed values, as text.
    pub allowed: &'static str,
}

/// Properties of a kind of fault.
#[derive(Debug)]
pub struct Kind {
    /// The kind.
    pub what: What,
    /// Name of the kind in schedule files.
    pub name: &'static str,
    /// Units that may be counted; the first is the default.
    pub sides: &'static [Side],
    /// Parameters of the kind.
    pub parameters: &'static [Parameter],
    /// One-line description.
    pub about: &'static str,
}

impl What {
    /// Returns the properties of the kind.
    pub fn kind(self) -> &'static Kind {
        // The table is in the order of the enum, which a test checks.
        &Kind::ALL[self as usize]
    }
}

impl std::fmt::Display for What {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.kind().name)
    }
}
