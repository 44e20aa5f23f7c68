//! Conversion of fields to and from the device's native messages (SCPI).

use super::{Field, Kind, Outcome, Value};
use crate::dialect::template::own_end;
use crate::scpi::{ErrorCode, Param, parse, quote, split_block};

impl Field {
    /// Formats a value as a SCPI parameter for the firmware.
    pub(in crate::dialect) fn to_scpi(&self, value: &Value) -> Outcome<String> {
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

    /// Parses a value from a firmware answer.
    pub(in crate::dialect) fn read_scpi(&self, raw: &[u8]) -> Outcome<Value> {
        let wrong = || {
            let start = &raw[..raw.len().min(40)];
            let what = format!(
                "{}: unexpected answer \"{}\"",
                self.name,
                start.escape_ascii()
            );
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
}

/// Joins the strings of a comma-separated list of quoted strings.
pub(super) fn unquoted(raw: &[u8]) -> Option<String> {
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
