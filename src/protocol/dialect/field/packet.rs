//! Conversion of fields to and from binary packets.

use super::{Field, Kind, Outcome, Value};
use crate::scpi::ErrorCode;

impl Field {
    /// Appends a value to a packet's data.
    pub(in crate::dialect) fn to_packet(&self, value: &Value, data: &mut Vec<u8>) -> Outcome<()> {
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

    /// Reads a value from the front of a packet's data and advances past it.
    pub(in crate::dialect) fn read_packet(&self, data: &mut &[u8]) -> Outcome<Value> {
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
        // A NaN fails the range check.
        self.base(number)
    }
}
