//! Types and units of wire values.

use serde::Deserialize;

/// Largest integer up to which an f64 represents all integers exactly (2^53).
const EXACT: f64 = 9_007_199_254_740_992.0;

/// Encoding of a value on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub(in crate::dialect) enum Kind {
    /// Line: an integer with optional sign.
    Int,
    /// Line: a decimal number.
    Float,
    /// Line: characters other than space.
    Word,
    /// Line: all characters up to the next part of the template. Packet: UTF-8, to the end of the
    /// data or padded with zeros to the field's size.
    Text,
    /// Line: a string in double quotes; quotes inside are doubled.
    Quoted,
    /// Line: bytes as pairs of hexadecimal digits; `-` if there are none.
    Hex,
    /// Line: an IEEE 488.2 block.
    Block,
    /// Packet: an unsigned byte.
    U8,
    /// Packet: two bytes, unsigned.
    U16,
    /// Packet: four bytes, unsigned.
    U32,
    /// Packet: two bytes, two's complement.
    I16,
    /// Packet: four bytes, two's complement.
    I32,
    /// Packet: four bytes, IEEE 754.
    F32,
    /// Packet: raw bytes, to the end of the data or of the field's size.
    Bytes,
}

impl Kind {
    /// Returns whether packets support the type. Text is valid in packets and lines.
    pub(in crate::dialect) fn in_packets(self) -> bool {
        self.width().is_some() || matches!(self, Self::Bytes | Self::Text)
    }

    /// Returns whether lines support the type.
    pub(in crate::dialect) fn in_lines(self) -> bool {
        self.width().is_none() && self != Self::Bytes
    }

    /// Returns the size of a number in a packet, in bytes.
    pub(in crate::dialect) fn width(self) -> Option<usize> {
        match self {
            Self::U8 => Some(1),
            Self::U16 | Self::I16 => Some(2),
            Self::U32 | Self::I32 | Self::F32 => Some(4),
            _ => None,
        }
    }

    pub(in crate::dialect) fn is_number(self) -> bool {
        self.width().is_some() || matches!(self, Self::Int | Self::Float)
    }

    pub(in crate::dialect) fn is_bytes(self) -> bool {
        matches!(self, Self::Hex | Self::Block | Self::Bytes)
    }

    pub(super) fn is_whole(self) -> bool {
        self.is_number() && !matches!(self, Self::Float | Self::F32)
    }

    /// Returns the representable range of numbers.
    pub(in crate::dialect) fn range(self) -> (f64, f64) {
        match self {
            Self::U8 => (0.0, u8::MAX.into()),
            Self::U16 => (0.0, u16::MAX.into()),
            Self::U32 => (0.0, u32::MAX.into()),
            Self::I16 => (i16::MIN.into(), i16::MAX.into()),
            Self::I32 => (i32::MIN.into(), i32::MAX.into()),
            Self::F32 => (f32::MIN.into(), f32::MAX.into()),
            Self::Float => (-1e300, 1e300),
            _ => (-EXACT, EXACT),
        }
    }
}

/// Unit of a number on the wire.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(in crate::dialect) enum Unit {
    /// No unit.
    #[default]
    #[serde(rename = "plain")]
    Plain,
    /// Seconds.
    #[serde(rename = "s")]
    Seconds,
    /// Milliseconds.
    #[serde(rename = "ms")]
    Milliseconds,
    /// Microseconds.
    #[serde(rename = "us")]
    Microseconds,
    /// Nanoseconds.
    #[serde(rename = "ns")]
    Nanoseconds,
    /// Decibels.
    #[serde(rename = "dB")]
    Decibels,
    /// Percent.
    #[serde(rename = "percent")]
    Percent,
}

impl Unit {
    /// Returns the number of units per base unit. Values are divided by it and not multiplied by its
    /// inverse, because 20 / 1e6 is the double nearest to 20 us.
    pub(in crate::dialect) fn divisor(self) -> f64 {
        match self {
            Self::Plain | Self::Seconds | Self::Decibels => 1.0,
            Self::Percent => 1e2,
            Self::Milliseconds => 1e3,
            Self::Microseconds => 1e6,
            Self::Nanoseconds => 1e9,
        }
    }
}
