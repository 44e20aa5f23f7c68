//! Admission of TCP clients to the stream of frames: the lines that may precede the first frame.
//!
//! Each line of the device is four letters, optionally a space and a text, and a newline:
//!
//! | line | meaning |
//! | --- | --- |
//! | `PHTK` | the device requires a token: the client sends it as a line, within [`DEADLINE`] |
//! | `PHOK` | the token is right; frames follow |
//! | `PHNO reason` | the client is refused; the device closes the connection |
//!
//! A device without a token admits a client without a line. `PHNO` may also come on the Unix socket,
//! if it has too many clients. The token is sent without encryption.

use phasmid_core::error::{Error, Result};
use std::fs::File;
use std::hint::black_box;
use std::io::Read;
use std::path::Path;
use std::time::Duration;

/// The device requires a token.
pub const TOKEN_REQUIRED: [u8; 4] = *b"PHTK";
/// The token is right.
pub const ADMITTED: [u8; 4] = *b"PHOK";
/// The client is refused.
pub const REFUSED: [u8; 4] = *b"PHNO";
/// Maximum length of a line of the device in bytes, including its newline.
pub const MAX_LINE: usize = 512;
/// Maximum time in which a client must present its token.
pub const DEADLINE: Duration = Duration::from_secs(5);
/// Minimum length of a token in characters.
pub const MIN_TOKEN_CHARS: usize = 16;
/// Maximum length of a token in bytes.
pub const MAX_TOKEN_BYTES: usize = 256;

/// A secret that a TCP client shares with the device.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

impl std::fmt::Debug for Token {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Token(..)")
    }
}

impl Token {
    /// Reads a token from a file with one line. White space around the token is ignored. Error
    /// messages do not contain the token.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, or if it does not hold one line of allowed length.
    pub fn read(path: &Path) -> Result<Self> {
        let io = |e| Error::io(path, e);
        let mut bytes = Vec::new();
        let file = File::open(path).map_err(io)?;
        // This limit leaves room for white space around the token, and bounds the size of a file
        // such as /dev/zero.
        let limit = 4 * MAX_TOKEN_BYTES as u64;
        file.take(limit).read_to_end(&mut bytes).map_err(io)?;
        Self::parse(&bytes).map_err(|found| {
            let expected = format!(
                "one line with a token of at least {MIN_TOKEN_CHARS} characters and at most \
                 {MAX_TOKEN_BYTES} bytes"
            );
            Error::input(path.display(), found, expected)
        })
    }

    /// Reads a token from a line. White space around the token is ignored.
    ///
    /// # Errors
    /// Returns a description of the invalid text.
    pub fn parse(bytes: &[u8]) -> Result<Self, String> {
        let text = std::str::from_utf8(bytes).map_err(|_| "not UTF-8 text".to_owned())?;
        let token = text.trim();
        let chars = token.chars().count();
        if token.lines().count() > 1 {
            Err("several lines".into())
        } else if token.chars().any(char::is_control) {
            Err("a control character".into())
        } else if chars < MIN_TOKEN_CHARS || token.len() > MAX_TOKEN_BYTES {
            Err(format!("a token of {chars} characters"))
        } else {
            Ok(Self(token.to_owned()))
        }
    }

    /// Returns the line with which a client presents the token.
    pub fn to_line(&self) -> String {
        format!("{}\n", self.0)
    }

    /// Returns whether a client's line, with or without its newline, holds the token. The time that
    /// this takes does not depend on where the two differ.
    pub fn matches(&self, line: &[u8]) -> bool {
        let given = line.trim_ascii();
        let padded = |bytes: &[u8]| {
            let mut all = [0_u8; MAX_TOKEN_BYTES];
            let len = bytes.len().min(MAX_TOKEN_BYTES);
            all[..len].copy_from_slice(&bytes[..len]);
            all
        };
        let (want, given_bytes) = (padded(self.0.as_bytes()), padded(given));
        let differing = want
            .iter()
            .zip(&given_bytes)
            .fold(0, |differing, (a, b)| black_box(differing | (a ^ b)));
        (differing == 0) & (given.len() == self.0.len())
    }
}

/// Returns the line that refuses a client.
pub fn refusal(reason: &str) -> Vec<u8> {
    let mut line = [&REFUSED[..], b" ", reason.as_bytes()].concat();
    line.truncate(MAX_LINE - 1);
    line.push(b'\n');
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECRET: &str = "0123456789abcdef";

    #[test]
    fn tokens_are_trimmed_and_compared_whole() {
        let token = Token::parse(format!("  {SECRET}\r\n").as_bytes()).unwrap();
        assert_eq!(token.to_line(), format!("{SECRET}\n"));
        for right in [SECRET.to_owned(), token.to_line(), format!("{SECRET}\r\n")] {
            assert!(token.matches(right.as_bytes()), "{right:?}");
        }
        for wrong in [
            "",
            "0123456789abcde",
            "0123456789abcdeg",
            "0123456789abcdef\0",
            "0123456789abcdef0123456789abcdef",
        ] {
            assert!(!token.matches(wrong.as_bytes()), "{wrong:?}");
        }
        assert!(!token.matches(&[b'x'; 4 * MAX_TOKEN_BYTES]));
        assert!(!format!("{token:?}").contains(SECRET));
    }

    #[test]
    fn unusable_tokens_are_rejected_without_being_printed() {
        let long = "x".repeat(MAX_TOKEN_BYTES + 1);
        for text in ["", "\n", "0123456789abcde", "0123456789abcdef\nx", &long] {
            let why = Token::parse(text.as_bytes()).unwrap_err();
            assert!(!why.contains("0123"), "{why}");
        }
        assert!(Token::parse(b"\xff0123456789abcdef").is_err());
        assert!(Token::parse(b"0123456789abcdef\x1b[").is_err());
    }
}
