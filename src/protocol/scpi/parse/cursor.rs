//! Reading a message byte by byte.

use crate::scpi::error::{DeviceError, ErrorCode};

/// A place in a message.
pub(super) struct Cursor<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) at: usize,
}

impl<'a> Cursor<'a> {
    /// The beginning of a message.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// The byte here.
    pub(super) fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    /// Steps over a byte if it is the one wanted.
    pub(super) fn eat(&mut self, byte: u8) -> bool {
        let is = self.peek() == Some(byte);
        self.at += usize::from(is);
        is
    }

    /// White space is every control character and the space (IEEE 488.2, 7.4.1.2).
    pub(super) fn skip_space(&mut self) -> bool {
        !self.take_while(|b| b <= b' ').is_empty()
    }

    /// Steps over the bytes that are kept, and gives them.
    pub(super) fn take_while(&mut self, keep: impl Fn(u8) -> bool) -> &'a [u8] {
        let start = self.at;
        while self.peek().is_some_and(&keep) {
            self.at += 1;
        }
        &self.bytes[start..self.at]
    }

    /// The error at this place: which character stands there, counted from 1.
    pub(super) fn error(&self, code: ErrorCode) -> DeviceError {
        code.with(match self.peek() {
            Some(byte) => format!("'{}' at character {}", byte.escape_ascii(), self.at + 1),
            None => "at the end".into(),
        })
    }
}

/// Bytes that are known to be ASCII.
pub(super) fn ascii(bytes: &[u8]) -> String {
    bytes.iter().map(|&b| char::from(b)).collect()
}
