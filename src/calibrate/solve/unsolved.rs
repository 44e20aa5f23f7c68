//! Why sightings give no rig.

/// What was found in place of sightings that determine a rig, and what is wanted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Unsolved {
    /// Fewer usable poses than the closed form needs.
    #[error("too few poses: {found}; wanted: {wanted}")]
    TooFewPoses {
        /// How many, and what became of the others.
        found: String,
        /// How many are needed.
        wanted: String,
    },
    /// More poses than a covariance of all of them is made for.
    #[error("too many poses: {found}; wanted: {wanted}")]
    TooManyPoses {
        /// How many.
        found: String,
        /// How many may be.
        wanted: String,
    },
    /// Boards that all face the same way.
    #[error("boards that face one way: {found}; wanted: {wanted}")]
    Parallel {
        /// The largest angle between two boards' normals.
        found: String,
        /// How large it has to be.
        wanted: String,
    },
    /// Boards as a mirror would show them.
    #[error("mirrored: {found}; wanted: {wanted}")]
    Mirrored {
        /// What is the wrong way round, in how many poses.
        found: String,
        /// What would be right.
        wanted: String,
    },
    /// Too little of the boards with projector coordinates: unlit, or not decoded.
    #[error("too few points whose projector coordinates are known: {found}; wanted: {wanted}")]
    Unlit {
        /// How many, in how many poses.
        found: String,
        /// How many are needed.
        wanted: String,
    },
    /// A board that stands nowhere before a rig that is known.
    #[error("the board cannot be placed: {found}; wanted: {wanted}")]
    Unplaced {
        /// What its points do.
        found: String,
        /// What they should.
        wanted: String,
    },
    /// Data that leave a parameter open, or fit no rig at all.
    #[error("the rig cannot be determined: {found}; wanted: {wanted}")]
    Undetermined {
        /// Which parameter, and how badly it is known.
        found: String,
        /// What would determine it.
        wanted: String,
    },
}
