//! Results of a search for a board: its measured points, in the camera image and in projector
//! coordinates, or the reason why none were found.

use glam::{DMat2, DVec2};
use phasmid_core::Stop;

/// A point of a board found in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// Column and row on the board.
    pub index: [u32; 2],
    /// Position in pixels. For a dot, the centroid of its imaged area, which is not the image of
    /// its centre; for a chessboard, the corner.
    pub px: DVec2,
    /// Covariance of `px` in pixels squared, from the image noise.
    pub covariance: DMat2,
    /// For a dot, the symmetric, positive matrix that maps the unit circle to its imaged outline
    /// about `px`, in pixels. Zero for a corner.
    pub outline: DMat2,
}

/// Measurements of one point of a board in one pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighting {
    /// Column and row on the board.
    pub index: [u32; 2],
    #[doc(hidden)]
    pub camera_px: DVec2,
    #[doc(hidden)]
    pub camera_covariance: DMat2,
    /// Projector coordinates at [`Self::camera_px`]; `None` if they could not be measured.
    pub projector: Option<Lit>,
}

impl Sighting {
    /// Returns the image of the point itself in pixels: for a dot its centre, with the perspective
    /// bias removed.
    pub fn camera_px(&self) -> [f64; 2] {
        self.camera_px.to_array()
    }

    /// Returns the covariance of [`Self::camera_px`] in pixels squared.
    pub fn camera_covariance(&self) -> [[f64; 2]; 2] {
        rows(self.camera_covariance)
    }
}

/// Projector coordinates at a camera pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lit {
    #[doc(hidden)]
    pub px: DVec2,
    #[doc(hidden)]
    pub slope: DMat2,
    #[doc(hidden)]
    pub covariance: DMat2,
}

impl Lit {
    /// Returns the projector column and row at the camera pixel, in pixels.
    pub fn px(&self) -> [f64; 2] {
        self.px.to_array()
    }

    /// Returns the rows of the derivative of [`Self::px`] with respect to the camera pixel. An
    /// error e of the camera pixel adds an error `slope * e` to the projector coordinates.
    pub fn slope(&self) -> [[f64; 2]; 2] {
        rows(self.slope)
    }

    /// Returns the covariance of [`Self::px`] in pixels squared, for an exactly known camera pixel.
    pub fn covariance(&self) -> [[f64; 2]; 2] {
        rows(self.covariance)
    }
}

fn rows(matrix: DMat2) -> [[f64; 2]; 2] {
    matrix.transpose().to_cols_array_2d()
}

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
    /// A grid that fits the board in several orientations, or in none.
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
    /// Only some of the board's points were found, although all are required.
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
