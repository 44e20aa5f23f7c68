//! Why a picture shows no board that can be used.

/// What was found in a picture in place of the board, and what is wanted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NotFound {
    /// Nothing that looks like one.
    #[error("no board: {found}; wanted: {wanted}")]
    Nothing {
        /// What there is.
        found: String,
        /// What a board would show.
        wanted: String,
    },
    /// A grid that could be labelled in more than one way, or not at all.
    #[error("a board that cannot be told which way round it is: {found}; wanted: {wanted}")]
    Ambiguous {
        /// What there is.
        found: String,
        /// What would decide.
        wanted: String,
    },
    /// The board's markers are in the order that a mirror would show.
    #[error("a mirrored picture: {found}; wanted: a picture that is not flipped")]
    Mirrored {
        /// What tells.
        found: String,
    },
    /// Some of the board's points, where all of them are needed.
    #[error("part of a board: {found}; wanted: {wanted}")]
    Partial {
        /// How much of it there is.
        found: String,
        /// The whole.
        wanted: String,
    },
    /// Another board than was said.
    #[error("another board: {found}; wanted: {wanted}")]
    WrongBoard {
        /// Its grid or its proportions.
        found: String,
        /// Those of the board that was said.
        wanted: String,
    },
}
