//! Conversion of fields to and from text lines.

use super::firmware::unquoted;
use super::{Field, Kind, Outcome, Value};
use crate::scpi::{ErrorCode, encode_block, quote, split_block};

impl Field {
    /// Formats a value for a line.
    pub(in crate::dialect) fn to_line(&self, value: &Value) -> Outcome<Vec<u8>> {
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

    /// Parses a value from a line.
    pub(in crate::dialect) fn read_line(&self, wire: &[u8]) -> Outcome<Value> {
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
}
