//! Measured points of a board, in the camera image and in projector coordinates.

use glam::{DMat2, DVec2};

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
    /// Image of the point itself in pixels: for a dot its centre, with the perspective bias
    /// removed.
    pub camera_px: DVec2,
    /// Covariance of `camera_px` in pixels squared.
    pub camera_covariance: DMat2,
    /// Projector coordinates at `camera_px`; `None` if they could not be measured.
    pub projector: Option<Lit>,
}

/// Projector coordinates at a camera pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lit {
    /// Projector column and row at `camera_px`, in pixels.
    pub px: DVec2,
    /// Derivative of `px` by the camera pixel; column j by coordinate j. An error e of `camera_px`
    /// adds an error `slope * e` to that of `px`.
    pub slope: DMat2,
    /// Covariance of `px` in pixels squared, for an exactly known `camera_px`.
    pub covariance: DMat2,
}
