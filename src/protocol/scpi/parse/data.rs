//! Program data: numbers, character data, strings and blocks (IEEE 488.2, 7.7), and the cursor that
//! reads a message byte by byte.

use crate::scpi::block;
use crate::scpi::error::{DeviceError, ErrorCode};
use crate::scpi::param::Param;

/// Maximum length of character data (IEEE 488.2, 7.7.1.4).
const MAX_NAME: usize = 12;
/// Maximum number of digits, excluding leading zeros (IEEE 488.2, 7.7.2.4.1).
const MAX_DIGITS: usize = 255;

/// Parses the parameters of a unit, up to the unit's end.
pub(super) fn params(cursor: &mut Cursor<'_>) -> Result<Vec<Param>, DeviceError> {
    let mut params = Vec::new();
    loop {
        cursor.skip_space();
        params.push(param(cursor)?);
        cursor.skip_space();
        match cursor.peek() {
            Some(b',') => cursor.at += 1,
            None | Some(b';') => return Ok(params),
            Some(_) => return Err(cursor.error(ErrorCode::InvalidSeparator)),
        }
    }
}

fn param(cursor: &mut Cursor<'_>) -> Result<Param, DeviceError> {
    match cursor.peek() {
        None | Some(b',' | b';') => Err(cursor.error(ErrorCode::SyntaxError)),
        Some(quote @ (b'"' | b'\'')) => string(cursor, quote),
        Some(b'#') => hash(cursor),
        Some(b'(') => Err(cursor.error(ErrorCode::ExpressionNotAllowed)),
        Some(b'0'..=b'9' | b'+' | b'-' | b'.') => number(cursor),
        Some(byte) if byte.is_ascii_alphabetic() => {
            let word = cursor.take_while(|b| b.is_ascii_alphanumeric() || b == b'_');
            if word.len() > MAX_NAME {
                return Err(ErrorCode::CharacterDataTooLong.with(ascii(&word[..MAX_NAME])));
            }
            Ok(Param::Name(ascii(word).to_ascii_uppercase()))
        }
        Some(byte) if byte.is_ascii_graphic() => Err(cursor.error(ErrorCode::SyntaxError)),
        Some(_) => Err(cursor.error(ErrorCode::InvalidCharacter)),
    }
}

fn string(cursor: &mut Cursor<'_>, quote: u8) -> Result<Param, DeviceError> {
    cursor.at += 1;
    let mut bytes = Vec::new();
    loop {
        bytes.extend_from_slice(cursor.take_while(|b| b != quote));
        if !cursor.eat(quote) {
            return Err(ErrorCode::InvalidStringData.with("no closing quote"));
        }
        if !cursor.eat(quote) {
            break;
        }
        bytes.push(quote);
    }
    String::from_utf8(bytes)
        .map(Param::Text)
        .map_err(|_| ErrorCode::InvalidStringData.with("not UTF-8"))
}

/// Parses a parameter that begins with `#`: a block, or a number in another base: `#H`, `#Q`, `#B`
/// (IEEE 488.2, 7.7.4).
fn hash(cursor: &mut Cursor<'_>) -> Result<Param, DeviceError> {
    let rest = &cursor.bytes[cursor.at..];
    if let Some((content, after)) = block::split(rest) {
        cursor.at = cursor.bytes.len() - after.len();
        return Ok(Param::Block(content.to_vec()));
    }
    let radix = match rest.get(1).map(u8::to_ascii_uppercase) {
        Some(b'H') => 16,
        Some(b'Q') => 8,
        Some(b'B') => 2,
        _ => {
            return Err(ErrorCode::InvalidBlockData.with("expected #<digits><length><bytes>"));
        }
    };
    cursor.at += 2;
    let digits = ascii(cursor.take_while(|b| b.is_ascii_alphanumeric()));
    let value = u64::from_str_radix(&digits, radix)
        .map_err(|_| ErrorCode::InvalidCharacterInNumber.with(&digits))?;
    Ok(Param::Number {
        value: value as f64,
        suffix: String::new(),
    })
}

fn number(cursor: &mut Cursor<'_>) -> Result<Param, DeviceError> {
    let start = cursor.at;
    cursor.take_while(|b| b == b'+' || b == b'-');
    let whole = cursor.take_while(|b| b.is_ascii_digit()).len();
    let point = cursor.eat(b'.');
    let part = if point {
        cursor.take_while(|b| b.is_ascii_digit()).len()
    } else {
        0
    };
    if whole + part > MAX_DIGITS {
        return Err(ErrorCode::TooManyDigits.into());
    }
    // `E` begins an exponent only if digits follow; otherwise it is part of a suffix.
    let mut ahead = cursor.at;
    if matches!(cursor.bytes.get(ahead), Some(b'e' | b'E')) {
        ahead += 1;
        if matches!(cursor.bytes.get(ahead), Some(b'+' | b'-')) {
            ahead += 1;
        }
        if cursor.bytes.get(ahead).is_some_and(u8::is_ascii_digit) {
            cursor.at = ahead;
            cursor.take_while(|b| b.is_ascii_digit());
        }
    }
    let text = ascii(&cursor.bytes[start..cursor.at]);
    let value: f64 = text
        .parse()
        .map_err(|_| ErrorCode::InvalidCharacterInNumber.with(&text))?;
    if !value.is_finite() {
        return Err(ErrorCode::ExponentTooLarge.into());
    }
    cursor.skip_space();
    let suffix = cursor.take_while(|b| b.is_ascii_alphabetic() || b == b'/');
    if suffix.len() > MAX_NAME {
        return Err(ErrorCode::SuffixTooLong.into());
    }
    Ok(Param::Number {
        value,
        suffix: ascii(suffix).to_ascii_uppercase(),
    })
}

/// A read position in a message.
pub(super) struct Cursor<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) at: usize,
}

impl<'a> Cursor<'a> {
    /// Returns a cursor at the beginning of a message.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// Returns the byte at the position; `None` at the end.
    pub(super) fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    /// Skips the next byte if it is `byte`, and returns whether it was.
    pub(super) fn eat(&mut self, byte: u8) -> bool {
        let is = self.peek() == Some(byte);
        self.at += usize::from(is);
        is
    }

    /// Skips white space, and returns whether there was any. The space and every control character
    /// count as white space (IEEE 488.2, 7.4.1.2).
    pub(super) fn skip_space(&mut self) -> bool {
        !self.take_while(|b| b <= b' ').is_empty()
    }

    /// Skips and returns the bytes for which `keep` is true.
    pub(super) fn take_while(&mut self, keep: impl Fn(u8) -> bool) -> &'a [u8] {
        let start = self.at;
        while self.peek().is_some_and(&keep) {
            self.at += 1;
        }
        &self.bytes[start..self.at]
    }

    /// Returns an error that names the next character and its position, counted from 1.
    pub(super) fn error(&self, code: ErrorCode) -> DeviceError {
        code.with(match self.peek() {
            Some(byte) => format!("'{}' at character {}", byte.escape_ascii(), self.at + 1),
            None => "at the end".into(),
        })
    }
}

/// Converts ASCII bytes to a string.
pub(super) fn ascii(bytes: &[u8]) -> String {
    bytes.iter().map(|&b| char::from(b)).collect()
}
