//! Errors of the solver.

use phasmid_core::error::Error;

/// Reasons why the observations do not determine a rig, with what was found and what is needed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Unsolved {
    /// Fewer usable poses than the closed form needs.
    #[error("too few poses: {found}; expected {wanted}")]
    TooFewPoses {
        /// Number of usable poses, and why the others are not usable.
        found: String,
        /// Number of poses needed.
        wanted: String,
    },
    /// More poses than the covariance matrix is limited to.
    #[error("too many poses: {found}; expected {wanted}")]
    TooManyPoses {
        /// Number of poses.
        found: String,
        /// Maximum number of poses.
        wanted: String,
    },
    /// The boards are parallel to each other.
    #[error("boards face the same way: {found}; expected {wanted}")]
    Parallel {
        /// Largest angle between the normals of two boards.
        found: String,
        /// Angle needed.
        wanted: String,
    },
    /// The boards appear mirrored.
    #[error("mirrored: {found}; expected {wanted}")]
    Mirrored {
        /// The mirrored image and the number of poses in which it is mirrored.
        found: String,
        /// The correct orientation.
        wanted: String,
    },
    /// Too few points have projector coordinates: they are not illuminated, or were not decoded.
    #[error("too few points whose projector coordinates are known: {found}; expected {wanted}")]
    Unlit {
        /// Number of points with projector coordinates and number of poses with such points.
        found: String,
        /// Number of points needed.
        wanted: String,
    },
    /// No pose of the board fits the observations for a known rig.
    #[error("the board cannot be placed: {found}; expected {wanted}")]
    Unplaced {
        /// Description of what is wrong with the points.
        found: String,
        /// Points needed.
        wanted: String,
    },
    /// The data leave a parameter undetermined, or fit no rig.
    #[error("the rig cannot be determined: {found}; expected {wanted}")]
    Undetermined {
        /// The parameter and its uncertainty, or the misfit.
        found: String,
        /// Data that would determine it.
        wanted: String,
    },
    /// The caller ended the call early.
    #[error("interrupted")]
    Interrupted,
}

impl From<Unsolved> for Error {
    fn from(why: Unsolved) -> Self {
        match why {
            Unsolved::Interrupted => Self::Interrupted,
            why => Self::rejected(why.to_string(), why),
        }
    }
}
