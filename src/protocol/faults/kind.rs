//! Kinds of faults and their properties.

use serde::{Deserialize, Serialize};

/// What can go wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
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
    /// A frame that ends with rows of the one before it.
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
    /// A command that the device refuses to take now.
    Nak,
    /// A port that goes away and comes back.
    Disconnect,
    /// A device that restarts.
    Reset,
}

/// What is counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
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
    /// Its field.
    pub name: &'static str,
    /// What it is when nothing is said, as text.
    pub default: &'static str,
    /// What may be said, as text.
    pub allowed: &'static str,
}

/// Properties of a kind of fault.
#[derive(Debug)]
pub struct Kind {
    /// The kind.
    pub what: What,
    /// Its name in files.
    pub name: &'static str,
    /// What may be counted; the first is what is counted when nothing is said.
    pub sides: &'static [Side],
    /// Its parameters.
    pub parameters: &'static [Parameter],
    /// What it does, in one line.
    pub about: &'static str,
}

impl What {
    /// Returns the properties of the kind.
    pub fn kind(self) -> &'static Kind {
        // In the order of the enum, as a test makes sure of.
        &Kind::ALL[self as usize]
    }
}

impl std::fmt::Display for What {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.kind().name)
    }
}
