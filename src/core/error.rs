//! One error type: what the user must mend (exit status 2) apart from what the machine or the
//! device did (exit status 1).

use std::fmt::Display;
use std::path::Path;

/// What went wrong, worded for the person at the terminal.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A mistake in what the user gave: names the place (file and line or field, address, flag),
    /// what was found there and what is allowed.
    #[error("{place}: {found}; allowed: {allowed}")]
    Input {
        /// Where: `file:line: field`, an address or a command-line flag.
        place: String,
        /// What stands there.
        found: String,
        /// What may stand there.
        allowed: String,
    },
    /// A file or socket that the system refused.
    #[error("{place}: {source}")]
    Io {
        /// The path or address.
        place: String,
        /// The system's own words.
        source: std::io::Error,
    },
    /// What a command of ours that ran as a process of its own has said.
    #[error("{words}")]
    Relayed {
        /// Its message.
        words: String,
        /// Its exit status.
        status: u8,
    },
    /// A device, link or peer that failed or broke its contract.
    #[error("{0}")]
    Device(String),
}

/// The crate's result.
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// A user's mistake at `place`: `found` there, where `allowed` would do.
    pub fn input(place: impl Display, found: impl Display, allowed: impl Display) -> Self {
        Self::Input {
            place: place.to_string(),
            found: found.to_string(),
            allowed: allowed.to_string(),
        }
    }

    /// A failure of a device, link or peer.
    pub fn device(message: impl Display) -> Self {
        Self::Device(message.to_string())
    }

    /// A system error at a path.
    pub fn io(path: impl AsRef<Path>, source: std::io::Error) -> Self {
        Self::Io {
            place: path.as_ref().display().to_string(),
            source,
        }
    }

    /// The same error with the place that led to it put before; a missing file becomes a mistake of
    /// whoever named it there.
    #[must_use]
    pub fn at(self, outer: impl Display) -> Self {
        match self {
            Self::Input {
                place,
                found,
                allowed,
            } => Self::Input {
                place: format!("{outer}: {place}"),
                found,
                allowed,
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

    /// The process's exit status: 2 for a user's mistake (a missing file among them), else 1.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Input { .. } => 2,
            Self::Relayed { status, .. } => *status,
            Self::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound => 2,
            Self::Io { .. } | Self::Device(_) => 1,
        }
    }
}
