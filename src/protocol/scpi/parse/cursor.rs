//! Byte-wise reading of a message.

use crate::scpi::error::{DeviceError, ErrorCode};

/// A read position in a message.
pub(super) struct Cursor<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) at: usize,
}

impl<'a> Cursor<'a> {
    /// Starts at the beginning of a message.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// Returns the byte at the position; `None` at the end.
    pub(super) fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    /// Skips the byte at the position if it is `byte`, and returns whether it is.
    pub(super) fn eat(&mut self, byte: u8) -> bool {
        let is = self.peek() == Some(byte);
        self.at += usize::from(is);
        is
    }

    /// Skips white space, and returns whether there was any. Every control character and the space
    /// count (IEEE 488.2, 7.4.1.2).
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

    /// Returns an error with the character at the position, counted from 1.
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
