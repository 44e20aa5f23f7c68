//! The error type. It separates user mistakes (exit status 2) from failures of the machine or the
//! device (exit status 1).
//!
//! One enum serves all crates. A caller decides by the variant (correct the input, retry, give up), and
//! every crate can fail in each of these ways; an enum per crate would repeat the variants and convert
//! them at every boundary, and the place of an error, which [`Error::at`] extends on its way up, would
//! have to be carried through each conversion. Reasons that a caller can act on have types of their own:
//! of a failed call ([`Error::Rejected`]) and of a successful call whose result is doubtful. Their
//! `Display` text is the message for users.

use std::error::Error as StdError;
use std::fmt::Display;
use std::path::Path;

/// An error whose message is written for the user at the terminal.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
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
    /// Several errors that were found together; displays as one line per error.
    #[error("{}", lines(.0))]
    Several(Vec<Error>),
    /// Further errors in the same input, which are counted but not listed.
    #[error("and {}{count} further error{}", if *.is_least { "at least " } else { "" }, if *.count == 1 { "" } else { "s" })]
    Further {
        /// Number of errors.
        count: usize,
        /// Whether `count` is only a minimum.
        is_least: bool,
    },
    /// The caller ended the call early.
    #[error("interrupted")]
    Interrupted,
    /// Input that a computation rejects. The [`source`](StdError::source) is the reason as a type of
    /// the crate that found it.
    #[error("{message}")]
    Rejected {
        /// The message, which contains the message of `source`.
        message: String,
        /// The reason.
        source: Box<dyn StdError + Send + Sync>,
    },
    /// A device, link or peer failed or violated its protocol.
    #[error("{0}")]
    Device(String),
}

fn lines(errors: &[Error]) -> String {
    let lines: Vec<String> = errors.iter().map(ToString::to_string).collect();
    lines.join("\n")
}

/// Result with this crate's [`Error`] by default.
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// Creates an error for a user mistake at `place`: `found` is the invalid input, `expected`
    /// describes valid input.
    pub fn input(place: impl Display, found: impl Display, expected: impl Display) -> Self {
        Self::Input {
            place: place.to_string(),
            found: found.to_string(),
            expected: expected.to_string(),
        }
    }

    /// Combines errors into one; a single error is returned unchanged.
    pub fn several(errors: Vec<Self>) -> Self {
        let mut errors: Vec<Self> = errors.into_iter().flat_map(Self::each).collect();
        match errors.len() {
            1 => errors.remove(0),
            _ => Self::Several(errors),
        }
    }

    fn each(self) -> Vec<Self> {
        match self {
            Self::Several(errors) => errors,
            other => vec![other],
        }
    }

    /// Creates an error for a failure of a device, link or peer.
    pub fn device(message: impl Display) -> Self {
        Self::Device(message.to_string())
    }

    /// Creates an error for input that a computation rejects. The message includes that of `source`.
    pub fn rejected(
        message: impl Display,
        source: impl Into<Box<dyn StdError + Send + Sync>>,
    ) -> Self {
        Self::Rejected {
            message: message.to_string(),
            source: source.into(),
        }
    }

    /// Creates an error for a system error at a path.
    pub fn io(path: impl AsRef<Path>, source: std::io::Error) -> Self {
        Self::Io {
            place: path.as_ref().display().to_string(),
            source,
        }
    }

    /// Returns the same error with `outer` prepended to its location. A missing file becomes a user
    /// mistake, because the user named the file at `outer`.
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
                Self::input(format!("{outer}: {place}"), source, "an existing file")
            }
            Self::Io { place, source } => Self::Io {
                place: format!("{outer}: {place}"),
                source,
            },
            Self::Several(errors) => {
                let outer = outer.to_string();
                let errors = errors.into_iter().map(|error| error.at(outer.as_str()));
                Self::Several(errors.collect())
            }
            Self::Interrupted | Self::Further { .. } => self,
            Self::Rejected { message, source } => Self::Rejected {
                message: format!("{outer}: {message}"),
                source,
            },
            Self::Device(message) => Self::Device(format!("{outer}: {message}")),
        }
    }

    /// Returns the process's exit status: 2 for a user mistake (including a missing file), else 1. For
    /// several errors, returns the largest status.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Input { .. } | Self::Rejected { .. } | Self::Further { .. } => 2,
            Self::Several(errors) => errors.iter().map(Self::exit_code).max().unwrap_or(1),
            Self::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound => 2,
            Self::Io { .. } | Self::Interrupted | Self::Device(_) => 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rejected_input_keeps_its_reason_as_source() {
        let reason = Error::device("too dark");
        let error = Error::rejected(format!("poses: {reason}"), reason).at("folder");
        assert_eq!(error.to_string(), "folder: poses: too dark");
        assert_eq!(error.exit_code(), 2);
        let source = error.source().and_then(|s| s.downcast_ref());
        assert!(matches!(source, Some(Error::Device(message)) if message == "too dark"));
    }
}
