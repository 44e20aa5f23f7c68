//! One argument or value: its type, its unit and its range, on the wire and in the device.

use super::Value;
use super::template::own_end;
use crate::protocol::scpi::{
    DeviceError, ErrorCode, Param, encode_block, parse, quote, split_block,
};
use serde::Deserialize;

/// Integers that a double holds without loss.
const EXACT: f64 = 9_007_199_254_740_992.0;

/// How a value stands on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Kind {
    /// Line: digits with or without a sign.
    Int,
    /// Line: a decimal number.
    Float,
    /// Line: characters without a space.
    Word,
    /// Line: the characters up to what follows in the template. Packet: UTF-8, to the end or padded
    /// with zeros to the field's size.
    Text,
    /// Line: a string in double quotes, those inside doubled.
    Quoted,
    /// Line: bytes as pairs of hexadecimal digits; `-` for none.
    Hex,
    /// Line: bytes as IEEE 488.2 has blocks.
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
    /// Packet: bytes, to the end or as many as the field's size.
    Bytes,
}

impl Kind {
    /// Whether it stands in packets rather than in lines; text stands in both.
    pub(super) fn in_packets(self) -> bool {
        self.width().is_some() || matches!(self, Self::Bytes | Self::Text)
    }

    /// Whether it stands in lines.
    pub(super) fn in_lines(self) -> bool {
        self.width().is_none() && self != Self::Bytes
    }

    /// Bytes of a number in a packet.
    pub(super) fn width(self) -> Option<usize> {
        match self {
            Self::U8 => Some(1),
            Self::U16 | Self::I16 => Some(2),
            Self::U32 | Self::I32 | Self::F32 => Some(4),
            _ => None,
        }
    }

    pub(super) fn is_number(self) -> bool {
        self.width().is_some() || matches!(self, Self::Int | Self::Float)
    }

    pub(super) fn is_bytes(self) -> bool {
        matches!(self, Self::Hex | Self::Block | Self::Bytes)
    }

    fn is_whole(self) -> bool {
        self.is_number() && !matches!(self, Self::Float | Self::F32)
    }

    /// The numbers that it can say.
    pub(super) fn range(self) -> (f64, f64) {
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

/// What a number on the wire counts.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
pub(super) enum Unit {
    /// Itself.
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
    /// Hundredths of the whole.
    #[serde(rename = "percent")]
    Percent,
}

impl Unit {
    /// Units in a base unit: a divisor, because 20 / 1e6 is the double nearest to 20 us.
    pub(super) fn divisor(self) -> f64 {
        match self {
            Self::Plain | Self::Seconds | Self::Decibels => 1.0,
            Self::Percent => 1e2,
            Self::Milliseconds => 1e3,
            Self::Microseconds => 1e6,
            Self::Nanoseconds => 1e9,
        }
    }
}

/// An argument or a value, checked.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) kind: Kind,
    /// Counts on the wire in a base unit.
    pub(super) divisor: f64,
    /// Allowed on the wire.
    pub(super) range: (f64, f64),
    /// What the wire says and the device's word for it; empty where anything goes.
    pub(super) choices: Vec<(String, String)>,
    /// Size in a packet.
    pub(super) bytes: Option<usize>,
    /// What is sent whatever is asked, and not looked at when it is received; in base units.
    pub(super) constant: Option<Value>,
    /// Most significant byte first.
    pub(super) big: bool,
}

type Outcome<T> = Result<T, DeviceError>;

impl Field {
    /// A number of a line without unit and range.
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

    /// Characters that it may have in a line.
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

    /// What stands on the wire for one of the choices.
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

    /// One of the choices for what stands on the wire.
    fn chosen(&self, wire: &str) -> Outcome<Value> {
        let known = self
            .choices
            .iter()
            .find(|(w, _)| w.eq_ignore_ascii_case(wire));
        known
            .map(|(_, word)| Value::Text(word.clone()))
            .ok_or_else(|| self.wrong(ErrorCode::IllegalParameterValue, format!("{wire:?}")))
    }

    /// The number on the wire, rounded to what its type holds.
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

    /// The value of a number on the wire.
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

    /// As it stands in a line.
    pub(super) fn to_line(&self, value: &Value) -> Outcome<Vec<u8>> {
        if self.kind.is_number() {
            return Ok(self.wire_number(value)?.to_string().into_bytes());
        }
        if self.kind.is_bytes() {
            let bytes = self.bytes_of(value)?;
            return Ok(match self.kind {
                Kind::Block => encode_block(bytes),
                _ if bytes.is_empty() => b"-".to_vec(),
                _ => bytes
                    .iter()
                    .flat_map(|b| format!("{b:02x}").into_bytes())
                    .collect(),
            });
        }
        if !self.choices.is_empty() {
            return Ok(self.wire_word(value)?.as_bytes().to_vec());
        }
        let text = self.checked_text(value)?;
        let fits = match self.kind {
            Kind::Quoted => return Ok(quote(text).into_bytes()),
            Kind::Word => !text.is_empty() && !text.contains(' '),
            _ => !text.is_empty() && text.trim() == text,
        };
        if !fits {
            return Err(self.wrong(ErrorCode::IllegalParameterValue, format!("{text:?}")));
        }
        Ok(text.as_bytes().to_vec())
    }

    /// Out of a line.
    pub(super) fn read_line(&self, wire: &[u8]) -> Outcome<Value> {
        let none = || {
            self.wrong(
                ErrorCode::DataTypeError,
                format!("\"{}\"", wire.escape_ascii()),
            )
        };
        match self.kind {
            Kind::Hex if wire == b"-" => return Ok(Value::Bytes(Vec::new())),
            Kind::Hex => {
                let digit = |b: u8| (b as char).to_digit(16);
                let pair = |pair: &[u8]| Some((digit(pair[0])? << 4 | digit(*pair.get(1)?)?) as u8);
                let bytes: Option<Vec<u8>> = wire.chunks(2).map(pair).collect();
                return bytes.map(Value::Bytes).ok_or_else(none);
            }
            Kind::Block => {
                return match split_block(wire) {
                    Some((content, [])) => Ok(Value::Bytes(content.to_vec())),
                    _ => Err(none()),
                };
            }
            _ => {}
        }
        let text = std::str::from_utf8(wire).map_err(|_| none())?;
        if self.kind.is_number() {
            let number = match self.kind {
                Kind::Int => text.parse::<i64>().ok().map(|number| number as f64),
                _ => text.parse().ok().filter(|number: &f64| number.is_finite()),
            };
            return self.base(number.ok_or_else(none)?);
        }
        if text.contains(char::is_control) {
            return Err(none());
        }
        match self.kind {
            Kind::Quoted => unquoted(wire).map(Value::Text).ok_or_else(none),
            Kind::Word if text.contains(' ') => Err(none()),
            _ if text.is_empty() => Err(none()),
            _ if !self.choices.is_empty() => self.chosen(text),
            _ => Ok(Value::Text(text.to_owned())),
        }
    }

    /// Appends it to a packet's data.
    pub(super) fn to_packet(&self, value: &Value, data: &mut Vec<u8>) -> Outcome<()> {
        let Some(width) = self.kind.width() else {
            let bytes = match self.kind {
                Kind::Text if self.choices.is_empty() => self.checked_text(value)?.as_bytes(),
                Kind::Text => self.wire_word(value)?.as_bytes(),
                _ => self.bytes_of(value)?,
            };
            if self.bytes.is_some_and(|size| bytes.len() > size) {
                let found = format!("{} bytes", bytes.len());
                return Err(self.wrong(ErrorCode::TooMuchData, found));
            }
            data.extend_from_slice(bytes);
            data.resize(
                data.len() + self.bytes.map_or(0, |size| size - bytes.len()),
                0,
            );
            return Ok(());
        };
        let number = self.wire_number(value)?;
        let mut bytes = match self.kind {
            Kind::F32 => (number as f32).to_le_bytes(),
            Kind::I16 | Kind::I32 => (number as i32).to_le_bytes(),
            _ => (number as u32).to_le_bytes(),
        };
        let bytes = &mut bytes[..width];
        if self.big {
            bytes.reverse();
        }
        data.extend_from_slice(bytes);
        Ok(())
    }

    /// Takes it off a packet's data.
    pub(super) fn read_packet(&self, data: &mut &[u8]) -> Outcome<Value> {
        let len = self.kind.width().or(self.bytes).unwrap_or(data.len());
        let Some((wire, rest)) = data.split_at_checked(len) else {
            return Err(ErrorCode::MissingParameter.with(&self.name));
        };
        *data = rest;
        if let Some(constant) = &self.constant {
            return Ok(constant.clone());
        }
        if let Kind::Bytes = self.kind {
            return Ok(Value::Bytes(wire.to_vec()));
        }
        if let Kind::Text = self.kind {
            let end = wire
                .iter()
                .rposition(|b| *b != 0)
                .map_or(0, |last| last + 1);
            let text = std::str::from_utf8(&wire[..end]).ok();
            let text = text.filter(|text| !text.contains(char::is_control));
            let shown = || format!("\"{}\"", wire[..end].escape_ascii());
            let text = text.ok_or_else(|| self.wrong(ErrorCode::DataTypeError, shown()))?;
            return match &self.choices[..] {
                [] => Ok(Value::Text(text.to_owned())),
                _ => self.chosen(text),
            };
        }
        let mut bytes = [0; 4];
        bytes[..wire.len()].copy_from_slice(wire);
        if self.big {
            bytes[..wire.len()].reverse();
        }
        let word = u32::from_le_bytes(bytes);
        let number = match self.kind {
            Kind::F32 => f64::from(f32::from_bits(word)),
            Kind::I16 => f64::from(word as u16 as i16),
            Kind::I32 => f64::from(word as i32),
            _ => f64::from(word),
        };
        // A NaN lies in no range.
        self.base(number)
    }

    /// As the firmware reads it.
    pub(super) fn to_scpi(&self, value: &Value) -> Outcome<String> {
        match value {
            Value::Number(number) => Ok(number.to_string()),
            Value::Text(word) if !self.choices.is_empty() => Ok(word.clone()),
            Value::Text(word) if self.kind == Kind::Word => {
                let plain = word.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_');
                match plain {
                    true => Ok(word.clone()),
                    false => Err(self.wrong(ErrorCode::IllegalParameterValue, word)),
                }
            }
            Value::Text(text) => Ok(quote(text)),
            Value::Bytes(_) => Err(self.wrong(ErrorCode::BlockDataNotAllowed, "bytes")),
        }
    }

    /// Out of the firmware's answer.
    pub(super) fn read_scpi(&self, raw: &[u8]) -> Outcome<Value> {
        let wrong = || {
            let start = &raw[..raw.len().min(40)];
            let what = format!("{}: the answer \"{}\"", self.name, start.escape_ascii());
            ErrorCode::SystemError.with(what)
        };
        if self.kind.is_bytes() {
            return Ok(Value::Bytes(match split_block(raw) {
                Some((content, [])) => content.to_vec(),
                _ => unquoted(raw).map_or_else(|| raw.to_vec(), String::into_bytes),
            }));
        }
        let text = match unquoted(raw) {
            Some(text) => text,
            None => String::from_utf8(raw.to_vec()).map_err(|_| wrong())?,
        };
        if !self.choices.is_empty() {
            let known = self
                .choices
                .iter()
                .find(|(_, w)| w.eq_ignore_ascii_case(&text));
            return known
                .map(|(_, word)| Value::Text(word.clone()))
                .ok_or_else(wrong);
        }
        if self.kind.is_number() {
            let number = text.parse().ok().filter(|number: &f64| number.is_finite());
            return number.map(Value::Number).ok_or_else(wrong);
        }
        Ok(Value::Text(text))
    }

    /// Some value that is allowed.
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

/// The strings of a list of strings in quotes, commas between them.
fn unquoted(raw: &[u8]) -> Option<String> {
    if raw.first() != Some(&b'"') || own_end(raw) != Some(raw.len()) {
        return None;
    }
    let program = parse(&[b"LIST ", raw].concat());
    let params = program.units.into_iter().flat_map(|unit| unit.params);
    let texts: Option<Vec<_>> = params
        .map(|param| match param {
            Param::Text(text) => Some(text),
            _ => None,
        })
        .collect();
    texts.map(|texts| texts.join(","))
}
