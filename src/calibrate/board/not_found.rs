//! Reasons why no usable board was found in an image.

use phasmid_core::Stop;

/// Error of a failed search: describes the content of the image and the expected content.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NotFound {
    /// Nothing that resembles the board.
    #[error("no board: {found}; expected {wanted}")]
    Nothing {
        /// Description of the image's content.
        found: String,
        /// Features of an image that shows the board.
        wanted: String,
    },
    /// A grid with several possible orientations, or with none that fits.
    #[error("a board whose orientation is ambiguous: {found}; expected {wanted}")]
    Ambiguous {
        /// Description of the image's content.
        found: String,
        /// Features that would resolve the ambiguity.
        wanted: String,
    },
    /// The board's markers are in mirrored order.
    #[error("a mirrored image: {found}; expected an image that is not flipped")]
    Mirrored {
        /// Evidence of the mirroring.
        found: String,
    },
    /// Only some of the board's points, if all are required.
    #[error("part of a board: {found}; expected {wanted}")]
    Partial {
        /// The part that was found.
        found: String,
        /// The complete board.
        wanted: String,
    },
    /// The caller ended the search early.
    #[error("interrupted")]
    Interrupted,
    /// A board other than the specified one.
    #[error("another board: {found}; expected {wanted}")]
    WrongBoard {
        /// Grid or proportions of the board found.
        found: String,
        /// Grid or proportions of the specified board.
        wanted: String,
    },
}

/// Returns an error if the search has been asked to end.
pub(super) fn check(stop: &Stop) -> Result<(), NotFound> {
    stop.check().map_err(|_| NotFound::Interrupted)
}
