//! Describes how a client departs from the recording.

use std::fmt;

/// Maximum number of expected and received bytes shown.
const SHOWN: usize = 64;

/// A difference between a client and the client in the recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Departure {
    /// Number of the expected record, or the number after the last record if the recording has
    /// ended.
    pub number: u64,
    /// Time of the expected record in the recording, or of the last record if the recording has
    /// ended.
    pub time_ns: u64,
    /// Expected action of the client, as recorded.
    pub expected: Said,
    /// Actual action of the client.
    pub came: Said,
}

/// Action of a client, expected or actual.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Said {
    /// Bytes.
    Bytes(Vec<u8>),
    /// Anything else, described in words.
    Words(&'static str),
}

impl fmt::Display for Departure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let same = match (&self.expected, &self.came) {
            (Said::Bytes(expected), Said::Bytes(came)) => {
                let pairs = expected.iter().zip(came);
                pairs.take_while(|(a, b)| a == b).count()
            }
            _ => 0,
        };
        write!(
            f,
            "record {} at {:.6} s: expected {}, but {}",
            self.number,
            self.time_ns as f64 * 1e-9,
            self.expected,
            self.came
        )?;
        match same {
            0 => Ok(()),
            same => write!(f, ", different from byte {same} on"),
        }
    }
}

impl fmt::Display for Said {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Words(words) => f.write_str(words),
            Self::Bytes(bytes) => f.write_str(&shown(bytes)),
        }
    }
}

/// Formats text in quotes and anything else in hexadecimal.
pub(super) fn shown(bytes: &[u8]) -> String {
    let start = &bytes[..bytes.len().min(SHOWN)];
    let is_text = |b: &u8| b.is_ascii_graphic() || b" \r\n\t".contains(b);
    let mut text = if start.iter().all(is_text) {
        format!("\"{}\"", start.escape_ascii())
    } else {
        let numbers: Vec<_> = start.iter().map(|b| format!("{b:02x}")).collect();
        numbers.join(" ")
    };
    if bytes.len() > SHOWN {
        text += &format!(" and {} bytes more", bytes.len() - SHOWN);
    }
    text
}
