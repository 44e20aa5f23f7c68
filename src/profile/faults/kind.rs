//! The kinds of faults, their parameters, and what a fault amounts to.

use super::{Direction, Fault};
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

/// A fault with its parameters as they act, times in nanoseconds of device time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Effect {
    /// The frame never arrives.
    Dropped,
    /// The frame arrives twice.
    Repeated,
    /// The frame arrives this much later.
    Late {
        /// How much.
        by_ns: u64,
    },
    /// The frame arrives after the next one, or when it has waited so long for one.
    Swapped {
        /// How long.
        wait_ns: u64,
    },
    /// From a row on, the frame is the one before it.
    Torn {
        /// The middle one when absent.
        row: Option<u32>,
    },
    /// Rows are missing, those below move up, and as many at the bottom are black.
    RowsMissing {
        /// The middle one when absent.
        row: Option<u32>,
        /// How many.
        rows: u32,
    },
    /// Bits are the other way round, anywhere in the frame.
    BitsFlipped {
        /// How many.
        count: u32,
    },
    /// The projector's light is off.
    Dark,
    /// Another pattern is shown.
    WrongPattern {
        /// Places from the right one; never 0.
        offset: i32,
    },
    /// The projector is lit for a part of the exposure.
    PartialExposure {
        /// What part, 0 to 1.
        fraction: f64,
    },
    /// The reply never arrives.
    NoReply,
    /// The reply arrives this much later.
    LateReply {
        /// How much.
        by_ns: u64,
    },
    /// The reply arrives twice.
    ReplyTwice,
    /// Random bytes before the reply.
    GarbageBefore {
        /// How many.
        count: u32,
    },
    /// Random bytes inside of the reply.
    GarbageInside {
        /// How many.
        count: u32,
    },
    /// Bits of the message are the other way round.
    BitErrors {
        /// Which way.
        direction: Direction,
        /// How many.
        bits: Bits,
    },
    /// The command is refused.
    Nak,
    /// The port is gone for so long.
    Disconnect {
        /// How long.
        for_ns: u64,
    },
    /// The device boots.
    Reset,
}

/// How many bits are the other way round.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bits {
    /// So many of a message.
    Count(u32),
    /// Each with this probability.
    Rate(f64),
}

const BY: Parameter = Parameter {
    name: "by_ms",
    default: "500",
    allowed: "0 to 3600000 ms",
};
const ROW: Parameter = Parameter {
    name: "row",
    default: "the middle row",
    allowed: "1 to 65535",
};
const GARBAGE: Parameter = Parameter {
    name: "count",
    default: "8",
    allowed: "1 to 4096 bytes",
};
const CAMERA: &[Side] = &[Side::Camera];
const PORT: &[Side] = &[Side::Port];

const fn kind(
    what: What,
    name: &'static str,
    sides: &'static [Side],
    parameters: &'static [Parameter],
    about: &'static str,
) -> Kind {
    Kind {
        what,
        name,
        sides,
        parameters,
        about,
    }
}

impl Kind {
    /// All kinds, those of frames first.
    pub const ALL: &'static [Self] = &[
        kind(
            What::Dropped,
            "dropped",
            CAMERA,
            &[],
            "the frame never arrives",
        ),
        kind(
            What::Repeated,
            "repeated",
            CAMERA,
            &[],
            "the frame arrives twice",
        ),
        kind(
            What::Late,
            "late",
            CAMERA,
            &[BY],
            "the frame arrives late, and those behind it wait",
        ),
        kind(
            What::Swapped,
            "swapped",
            CAMERA,
            &[Parameter {
                name: "by_ms",
                default: "1000",
                allowed: "0 to 3600000 ms",
            }],
            "the frame arrives after the next one, or after by_ms where none comes",
        ),
        kind(
            What::Torn,
            "torn",
            CAMERA,
            &[ROW],
            "from a row on, the frame is the one before it",
        ),
        kind(
            What::RowsMissing,
            "rows-missing",
            CAMERA,
            &[
                ROW,
                Parameter {
                    name: "rows",
                    default: "8",
                    allowed: "1 to 65535",
                },
            ],
            "rows are missing, those below move up, and as many at the bottom are black",
        ),
        kind(
            What::BitsFlipped,
            "bits-flipped",
            CAMERA,
            &[Parameter {
                name: "count",
                default: "64",
                allowed: "1 to 1000000 bits",
            }],
            "bits anywhere in the frame, the embedded data line included, are the other way round",
        ),
        kind(
            What::Dark,
            "dark",
            CAMERA,
            &[],
            "the projector's lamp is off",
        ),
        kind(
            What::WrongPattern,
            "wrong-pattern",
            CAMERA,
            &[Parameter {
                name: "offset",
                default: "1",
                allowed: "-4096 to 4096, not 0",
            }],
            "the projector shows the pattern that stands offset places further in the sequence",
        ),
        kind(
            What::PartialExposure,
            "partial-exposure",
            CAMERA,
            &[Parameter {
                name: "fraction",
                default: "0.5",
                allowed: "0 to 1",
            }],
            "the projector is lit for that fraction of the exposure",
        ),
        kind(
            What::NoReply,
            "no-reply",
            PORT,
            &[],
            "the reply never arrives",
        ),
        kind(
            What::LateReply,
            "late-reply",
            PORT,
            &[BY],
            "the reply arrives late, and those behind it wait",
        ),
        kind(
            What::ReplyTwice,
            "reply-twice",
            PORT,
            &[],
            "the reply arrives twice",
        ),
        kind(
            What::GarbageBefore,
            "garbage-before",
            PORT,
            &[GARBAGE],
            "random bytes arrive before the reply",
        ),
        kind(
            What::GarbageInside,
            "garbage-inside",
            PORT,
            &[GARBAGE],
            "random bytes arrive inside of the reply",
        ),
        kind(
            What::BitErrors,
            "bit-errors",
            PORT,
            &[
                Parameter {
                    name: "direction",
                    default: "to-host",
                    allowed: "to-device or to-host",
                },
                Parameter {
                    name: "count",
                    default: "1",
                    allowed: "1 to 4096 bits of a message",
                },
                Parameter {
                    name: "rate",
                    default: "a count instead",
                    allowed: "0 to 1 for each bit",
                },
            ],
            "bits of a message are the other way round",
        ),
        kind(
            What::Nak,
            "nak",
            PORT,
            &[],
            "the command is refused as by a device that is busy, and not executed",
        ),
        kind(
            What::Disconnect,
            "disconnect",
            &[Side::Port, Side::Camera],
            &[Parameter {
                name: "for_ms",
                default: "1000",
                allowed: "0 to 3600000 ms",
            }],
            "the control port is gone for that long, and all on its way with it",
        ),
        kind(
            What::Reset,
            "reset",
            &[Side::Camera, Side::Port],
            &[],
            "the device boots: settings, uploads and frames under way are gone",
        ),
    ];
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

impl Fault {
    /// What it amounts to: its parameters, and for those that are absent what stands in
    /// [`Kind::ALL`]. Out of a fault that has not been checked, values are brought into their ranges.
    pub fn effect(&self) -> Effect {
        let ns = |ms: Option<f64>, default: f64| (ms.unwrap_or(default).max(0.0) * 1e6) as u64;
        let count = |default: u32| self.count.unwrap_or(default).clamp(1, 1_000_000);
        match self.what {
            What::Dropped => Effect::Dropped,
            What::Repeated => Effect::Repeated,
            What::Late => Effect::Late {
                by_ns: ns(self.by_ms, 500.0),
            },
            What::Swapped => Effect::Swapped {
                wait_ns: ns(self.by_ms, 1000.0),
            },
            What::Torn => Effect::Torn { row: self.row },
            What::RowsMissing => Effect::RowsMissing {
                row: self.row,
                rows: self.rows.unwrap_or(8),
            },
            What::BitsFlipped => Effect::BitsFlipped { count: count(64) },
            What::Dark => Effect::Dark,
            What::WrongPattern => Effect::WrongPattern {
                offset: self.offset.unwrap_or(1),
            },
            What::PartialExposure => Effect::PartialExposure {
                fraction: self.fraction.unwrap_or(0.5).clamp(0.0, 1.0),
            },
            What::NoReply => Effect::NoReply,
            What::LateReply => Effect::LateReply {
                by_ns: ns(self.by_ms, 500.0),
            },
            What::ReplyTwice => Effect::ReplyTwice,
            What::GarbageBefore => Effect::GarbageBefore { count: count(8) },
            What::GarbageInside => Effect::GarbageInside { count: count(8) },
            What::BitErrors => Effect::BitErrors {
                direction: self.direction.unwrap_or_default(),
                bits: match self.rate {
                    Some(rate) => Bits::Rate(rate),
                    None => Bits::Count(count(1)),
                },
            },
            What::Nak => Effect::Nak,
            What::Disconnect => Effect::Disconnect {
                for_ns: ns(self.for_ms, 1000.0),
            },
            What::Reset => Effect::Reset,
        }
    }
}
