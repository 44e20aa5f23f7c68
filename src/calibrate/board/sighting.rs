//! One point of a board as it was seen and lit.

use glam::{DMat2, DVec2};

/// A board's point in a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// Column and row on the board.
    pub index: [u32; 2],
    /// Of a dot: the centroid of its image's area, which is not the image of its centre. Of a
    /// corner: the corner. In pixels.
    pub px: DVec2,
    /// Covariance of `px` in pixels squared, from the picture's noise.
    pub covariance: DMat2,
    /// Of a dot: the matrix that takes the unit circle to its image's outline about `px`, in pixels
    /// (symmetric, positive). Zero for a corner.
    pub outline: DMat2,
}

/// What the calibration knows of one point of a board in one pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighting {
    /// Column and row on the board.
    pub index: [u32; 2],
    /// The image of the point itself (a dot's centre, freed of the bias of its outline), in pixels.
    pub camera_px: DVec2,
    /// Covariance of `camera_px` in pixels squared.
    pub camera_covariance: DMat2,
    /// Where the projector lit it, if it did.
    pub projector: Option<Lit>,
}

/// The projector's pixel at a camera pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lit {
    /// Projector column and row at `camera_px`, in pixels.
    pub px: DVec2,
    /// Its derivative by the camera pixel; column j by coordinate j. An error e of `camera_px` is an
    /// error `slope * e` of `px`, on top of its own.
    pub slope: DMat2,
    /// Covariance of `px` at a `camera_px` that is certain, in pixels squared.
    pub covariance: DMat2,
}
