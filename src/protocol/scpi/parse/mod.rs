//! Parses a program message into its units (IEEE 488.2 chapter 7, SCPI-1999 volume 1 chapter 6).
//! The result depends only on the message's bytes.

mod data;
#[cfg(test)]
mod tests;

use super::error::{DeviceError, ErrorCode};
use super::param::Param;
use data::{Cursor, ascii, params};

/// Maximum mnemonic length (IEEE 488.2, 7.6.1.4.1).
const MAX_MNEMONIC: usize = 12;

/// Maximum number of mnemonics in a header, including inherited ones; no device has that many. With
/// this limit, the memory for a line of commands that inherit from each other is proportional to the
/// length of the line.
const MAX_NODES: usize = 16;

/// One mnemonic of a header in upper case, with its numeric suffix if any.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Node {
    /// Letters, digits and underscores, without trailing digits.
    pub name: String,
    /// Value of the trailing digits.
    pub suffix: Option<u32>,
}

/// A program message unit: one command or query.
#[derive(Debug, Clone, PartialEq)]
pub struct Unit {
    /// Whether the header is that of a common command, for example `*IDN?`.
    pub common: bool,
    /// The header from the root, including nodes inherited from the previous unit.
    pub path: Vec<Node>,
    /// Whether the header ends with `?`.
    pub query: bool,
    /// Parameters.
    pub params: Vec<Param>,
}

impl Unit {
    /// Returns the header as text, for messages.
    pub fn header(&self) -> String {
        let mut text = String::from(if self.common { "*" } else { "" });
        for (i, node) in self.path.iter().enumerate() {
            if i > 0 {
                text.push(':');
            }
            text.push_str(&node.name);
            if let Some(suffix) = node.suffix {
                text.push_str(&suffix.to_string());
            }
        }
        if self.query {
            text.push('?');
        }
        text
    }
}

/// Units of a message up to its first error; the rest of the message is void.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Program {
    /// Units in order.
    pub units: Vec<Unit>,
    /// Error that ended the message early.
    pub error: Option<DeviceError>,
}

/// Parses a message without its terminator.
pub fn parse(message: &[u8]) -> Program {
    let mut cursor = Cursor::new(message);
    let mut program = Program::default();
    let mut node = Vec::new();
    loop {
        cursor.skip_space();
        match cursor.peek() {
            None => return program,
            // Empty units are ignored, because a trailing `;` is common and harmless.
            Some(b';') => cursor.at += 1,
            Some(_) => match unit(&mut cursor, &mut node) {
                Ok(unit) => program.units.push(unit),
                Err(error) => {
                    program.error = Some(error);
                    return program;
                }
            },
        }
    }
}

/// Parses one unit. `node` is the inherited header path; it is updated for the next unit.
fn unit(cursor: &mut Cursor<'_>, node: &mut Vec<Node>) -> Result<Unit, DeviceError> {
    let common = cursor.eat(b'*');
    let mut path = if common || cursor.eat(b':') {
        Vec::new()
    } else {
        node.clone()
    };
    path.push(mnemonic(cursor)?);
    while !common && cursor.eat(b':') {
        path.push(mnemonic(cursor)?);
    }
    if path.len() > MAX_NODES {
        let what = format!("a header of more than {MAX_NODES} mnemonics");
        return Err(ErrorCode::UndefinedHeader.with(what));
    }
    let query = cursor.eat(b'?');
    if !common {
        node.clone_from(&path);
        node.pop();
    }
    let spaced = cursor.skip_space();
    let params = match cursor.peek() {
        None | Some(b';') => Vec::new(),
        Some(_) if spaced => params(cursor)?,
        Some(byte) if byte.is_ascii_graphic() => {
            return Err(cursor.error(ErrorCode::HeaderSeparatorError));
        }
        Some(_) => return Err(cursor.error(ErrorCode::InvalidCharacter)),
    };
    Ok(Unit {
        common,
        path,
        query,
        params,
    })
}

fn mnemonic(cursor: &mut Cursor<'_>) -> Result<Node, DeviceError> {
    match cursor.peek() {
        Some(byte) if byte.is_ascii_alphabetic() => {}
        Some(byte) if byte.is_ascii_graphic() => {
            return Err(cursor.error(ErrorCode::CommandHeaderError));
        }
        None => return Err(cursor.error(ErrorCode::CommandHeaderError)),
        Some(_) => return Err(cursor.error(ErrorCode::InvalidCharacter)),
    }
    let word = cursor.take_while(|b| b.is_ascii_alphanumeric() || b == b'_');
    if word.len() > MAX_MNEMONIC {
        return Err(ErrorCode::ProgramMnemonicTooLong.with(ascii(&word[..MAX_MNEMONIC])));
    }
    let digits = word.iter().rev().take_while(|b| b.is_ascii_digit()).count();
    let (name, suffix) = word.split_at(word.len() - digits);
    let suffix = match suffix {
        [] => None,
        digits => Some(
            ascii(digits)
                .parse()
                .map_err(|_| ErrorCode::HeaderSuffixOutOfRange.with(ascii(word)))?,
        ),
    };
    Ok(Node {
        name: ascii(name).to_ascii_uppercase(),
        suffix,
    })
}
