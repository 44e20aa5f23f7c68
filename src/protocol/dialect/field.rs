//! An argument or reply value: its type, unit and range on the wire and in the device.

mod firmware;
mod kind;
mod line;
mod packet;

pub(super) use kind::{Kind, Unit};

use super::Value;
use crate::scpi::{DeviceError, ErrorCode};

/// A validated argument or value.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) kind: Kind,
    /// Number of wire counts per base unit.
    pub(super) divisor: f64,
    /// Minimum and maximum of the number on the wire.
    pub(super) range: (f64, f64),
    /// Pairs of a word on the wire and the device's word for it; empty if the field has no list of
    /// choices.
    pub(super) choices: Vec<(String, String)>,
    /// Size in a packet, in bytes.
    pub(super) bytes: Option<usize>,
    /// Constant that is always sent and ignored on reception, in base units.
    pub(super) constant: Option<Value>,
    /// Whether numbers in packets are big-endian (most significant byte first).
    pub(super) big: bool,
}

type Outcome<T> = Result<T, DeviceError>;

impl Field {
    /// Creates an integer field of a line, without unit and range.
    pub(super) fn int(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            kind: Kind::Int,
            divisor: 1.0,
            range: Kind::Int.range(),
            choices: Vec::new(),
            bytes: None,
            constant: None,
            big: false,
        }
    }

    /// Returns the test for characters that the field may contain in a line.
    pub(super) fn characters(&self) -> fn(u8) -> bool {
        match self.kind {
            Kind::Int => |b| b.is_ascii_digit() || matches!(b, b'+' | b'-'),
            Kind::Float => |b| b.is_ascii_digit() || matches!(b, b'+' | b'-' | b'.' | b'e' | b'E'),
            Kind::Hex => |b| b.is_ascii_hexdigit() || b == b'-',
            Kind::Word => |b| b.is_ascii_graphic() || b >= 0x80,
            _ => |_| true,
        }
    }

    fn wrong(&self, code: ErrorCode, found: impl std::fmt::Display) -> DeviceError {
        let allowed = match (&self.choices[..], self.kind) {
            ([], kind) if kind.is_number() => format!("{} to {}", self.range.0, self.range.1),
            ([], kind) => format!("{kind:?}").to_lowercase(),
            (choices, _) => {
                let words: Vec<_> = choices.iter().map(|(wire, _)| wire.as_str()).collect();
                words.join(", ")
            }
        };
        code.with(format!("{}: {found}, allowed {allowed}", self.name))
    }

    /// Returns the dialect's word on the wire for a value of the device.
    fn wire_word(&self, value: &Value) -> Outcome<&str> {
        let word = value.to_string();
        let known = self
            .choices
            .iter()
            .find(|(_, w)| w.eq_ignore_ascii_case(&word));
        match known {
            Some((wire, _)) => Ok(wire),
            None => {
                let words: Vec<_> = self.choices.iter().map(|(_, w)| w.as_str()).collect();
                let what = format!("{}: {word:?}, allowed {}", self.name, words.join(", "));
                Err(ErrorCode::IllegalParameterValue.with(what))
            }
        }
    }

    /// Returns the device's word for a word on the wire.
    fn chosen(&self, wire: &str) -> Outcome<Value> {
        let known = self
            .choices
            .iter()
            .find(|(w, _)| w.eq_ignore_ascii_case(wire));
        known
            .map(|(_, word)| Value::Text(word.clone()))
            .ok_or_else(|| self.wrong(ErrorCode::IllegalParameterValue, format!("{wire:?}")))
    }

    /// Returns the number on the wire, rounded for integer types.
    fn wire_number(&self, value: &Value) -> Outcome<f64> {
        if !self.choices.is_empty() {
            return Ok(self.wire_word(value)?.parse().unwrap_or(0.0));
        }
        let Value::Number(base) = value else {
            return Err(self.wrong(ErrorCode::DataTypeError, format!("\"{value}\"")));
        };
        let exact = base * self.divisor;
        let number = if self.kind.is_whole() {
            exact.round()
        } else {
            exact
        };
        self.within(number)
    }

    fn within(&self, number: f64) -> Outcome<f64> {
        if (self.range.0..=self.range.1).contains(&number) {
            return Ok(number);
        }
        Err(self.wrong(ErrorCode::DataOutOfRange, number))
    }

    /// Converts a number on the wire to a value in base units.
    fn base(&self, number: f64) -> Outcome<Value> {
        if !self.choices.is_empty() {
            return self.chosen(&number.to_string());
        }
        Ok(Value::Number(self.within(number)? / self.divisor))
    }

    fn checked_text<'a>(&self, value: &'a Value) -> Outcome<&'a str> {
        match value {
            Value::Text(text) if !text.contains(char::is_control) => Ok(text),
            _ => Err(self.wrong(ErrorCode::DataTypeError, format!("\"{value}\""))),
        }
    }

    fn bytes_of<'a>(&self, value: &'a Value) -> Outcome<&'a [u8]> {
        match value {
            Value::Bytes(bytes) => Ok(bytes),
            Value::Text(text) => Ok(text.as_bytes()),
            Value::Number(_) => Err(self.wrong(ErrorCode::DataTypeError, value)),
        }
    }

    /// Returns an example of an allowed value.
    pub(super) fn example(&self) -> Value {
        if let Some(constant) = &self.constant {
            return constant.clone();
        }
        if let Some((_, word)) = self.choices.first() {
            return Value::Text(word.clone());
        }
        match self.kind {
            kind if kind.is_number() => {
                let near_zero = 0f64.clamp(self.range.0, self.range.1);
                Value::Number(near_zero / self.divisor)
            }
            kind if kind.is_bytes() => Value::Bytes(Vec::new()),
            _ => Value::Text("a".to_owned()),
        }
    }
}
