//! The error type. It separates user mistakes (exit status 2) from failures of the machine or the
//! device (exit status 1).

use std::fmt::Display;
use std::path::Path;

/// An error whose message is written for the user at the terminal.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A mistake in the user's input: where it is (file and line or field, address, flag), what was
    /// found there and what was expected.
    #[error("{place}: {found}; expected {expected}")]
    Input {
        /// Location: `file:line: field`, an address or a command-line flag.
        place: String,
        /// The value or text found.
        found: String,
        /// The expected values.
        expected: String,
    },
    /// An operating-system error on a file or socket.
    #[error("{place}: {source}")]
    Io {
        /// The path or address.
        place: String,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// An error message relayed from a Phasmid command that ran in a separate process.
    #[error("{words}")]
    Relayed {
        /// Its message.
        words: String,
        /// Its exit status.
        status: u8,
    },
    /// A device, link or peer failed or violated its protocol.
    #[error("{0}")]
    Device(String),
}

/// Result with this crate's [`Error`] by default.
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// Creates an error for a user mistake at `place`: `found` was there, `expected` describes valid input.
    pub fn input(place: impl Display, found: impl Display, expected: impl Display) -> Self {
        Self::Input {
            place: place.to_string(),
            found: found.to_string(),
            expected: expected.to_string(),
        }
    }

    /// Creates an error for a failure of a device, link or peer.
    pub fn device(message: impl Display) -> Self {
        Self::Device(message.to_string())
    }

    /// Creates an error for a system error at a path.
    pub fn io(path: impl AsRef<Path>, source: std::io::Error) -> Self {
        Self::Io {
            place: path.as_ref().display().to_string(),
            source,
        }
    }

    /// Returns the same error with `outer` prepended to its location. A missing file becomes a user
    /// mistake, because the user's input at `outer` named it.
    #[must_use]
    pub fn at(self, outer: impl Display) -> Self {
        match self {
            Self::Input {
                place,
                found,
                expected,
            } => Self::Input {
                place: format!("{outer}: {place}"),
                found,
                expected,
            },
            Self::Io { place, source } if source.kind() == std::io::ErrorKind::NotFound => {
                Self::input(format!("{outer}: {place}"), source, "a file that is there")
            }
            Self::Io { place, source } => Self::Io {
                place: format!("{outer}: {place}"),
                source,
            },
            Self::Relayed { words, status } => Self::Relayed {
                words: format!("{outer}: {words}"),
                status,
            },
            Self::Device(message) => Self::Device(format!("{outer}: {message}")),
        }
    }

    /// Returns the process's exit status: 2 for a user mistake (including a missing file), else 1.
    /// A relayed error keeps its own status.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Input { .. } => 2,
            Self::Relayed { status, .. } => *status,
            Self::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound => 2,
            Self::Io { .. } | Self::Device(_) => 1,
        }
    }
}
