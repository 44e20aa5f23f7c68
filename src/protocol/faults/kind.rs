//! The kinds of faults and what is to be known of them.

use serde::{Deserialize, Serialize};

/// What can go wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum What {
    /// A frame that never arrives.
    Dropped,
    /// A frame that arrives twice.
    Repeated,
    /// A frame that arrives late; those behind it wait.
    Late,
    /// A frame that arrives after the next one.
    Swapped,
    /// A frame that ends with rows of the one before it.
    Torn,
    /// A frame that has lost rows.
    RowsMissing,
    /// Bits of a frame that are the other way round.
    BitsFlipped,
    /// A frame without the projector's light.
    Dark,
    /// A frame of another pattern of the sequence.
    WrongPattern,
    /// A frame that has seen the projector's light for a part of its exposure.
    PartialExposure,
    /// A reply that never arrives.
    NoReply,
    /// A reply that arrives late; those behind it wait.
    LateReply,
    /// A reply that arrives twice.
    ReplyTwice,
    /// Bytes before a reply that nobody sent.
    GarbageBefore,
    /// Bytes inside of a reply that nobody sent.
    GarbageInside,
    /// Bits on the line that are the other way round.
    BitErrors,
    /// A command that the device refuses to take now.
    Nak,
    /// A port that goes away and comes back.
    Disconnect,
    /// A device that boots.
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

/// What is to be known of a kind of fault.
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
    /// What is to be known of the kind.
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
