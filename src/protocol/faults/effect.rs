//! Effect of a fault.

use super::kind::What;
use super::{Direction, Fault};

/// A fault with resolved parameters, times in nanoseconds of device time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Effect {
    /// The frame never arrives.
    Dropped,
    /// The frame arrives twice.
    Repeated,
    /// The frame arrives this much later.
    Late {
        /// Delay.
        by_ns: u64,
    },
    /// The frame arrives after the next one, or after a maximum wait if none follows.
    Swapped {
        /// Maximum wait.
        wait_ns: u64,
    },
    /// The frame shows the previous frame in all rows from `row` on.
    Torn {
        /// First affected row; the middle row when absent.
        row: Option<u32>,
    },
    /// Rows are missing: the rows below move up, and as many rows at the bottom are black.
    RowsMissing {
        /// First missing row; the middle row when absent.
        row: Option<u32>,
        /// Number of missing rows.
        rows: u32,
    },
    /// Bits are flipped at random positions in the frame.
    BitsFlipped {
        /// Number of bits.
        count: u32,
    },
    /// The projector's light is off.
    Dark,
    /// Another pattern is shown.
    WrongPattern {
        /// Offset from the correct pattern; never 0.
        offset: i32,
    },
    /// The projector is lit for only part of the exposure.
    PartialExposure {
        /// Fraction of the exposure, 0 to 1.
        fraction: f64,
    },
    /// The reply never arrives.
    NoReply,
    /// The reply arrives this much later.
    LateReply {
        /// Delay.
        by_ns: u64,
    },
    /// The reply arrives twice.
    ReplyTwice,
    /// Random bytes precede the reply.
    GarbageBefore {
        /// Number of bytes.
        count: u32,
    },
    /// Random bytes appear inside the reply.
    GarbageInside {
        /// Number of bytes.
        count: u32,
    },
    /// Bits of the message are flipped.
    BitErrors {
        /// Direction of the affected bytes.
        direction: Direction,
        /// Number or rate of flipped bits.
        bits: Bits,
    },
    /// The command is refused.
    Nak,
    /// The port disappears for a time.
    Disconnect {
        /// Duration.
        for_ns: u64,
    },
    /// The device restarts.
    Reset,
}

/// Number of flipped bits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bits {
    /// This many bits of each message.
    Count(u32),
    /// Each bit with this probability.
    Rate(f64),
}

impl Fault {
    /// Returns the effect of the fault. Absent parameters take their defaults from the list of
    /// kinds ([`Kind`](super::Kind)); values of a fault that has not been checked are clamped to
    /// their ranges.
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
