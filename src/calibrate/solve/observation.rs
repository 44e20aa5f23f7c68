//! Detected points as observations of unit variance.
//!
//! A camera point c has covariance C. A projector coordinate p was read at the observed camera
//! point, not at the true one, so its error is S e + n: e is the camera point's error, S the slope
//! (the derivative of p with respect to c), n the decoder's own noise of covariance N. With
//! residuals r_c and r_p (observed minus predicted), the four numbers W_c r_c and W_p (r_p - S r_c)
//! are uncorrelated and of variance 1 if W_c' W_c = C^-1 and W_p' W_p = N^-1. This whitens the
//! joint 4 x 4 covariance [C, C S'; S C, S C S' + N].

use crate::board::Sighting;
use glam::{DMat2, DVec2};
use phasmid_geometry::Board;

/// The observed board points of one pose.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseSightings {
    /// Name of the pose, for example its folder's name.
    pub name: String,
    /// Observed points in any order; each index occurs once.
    pub sightings: Vec<Sighting>,
}

/// Observations of a board point.
#[derive(Debug, Clone)]
pub(super) struct Observation {
    pub index: [u32; 2],
    /// Position on the board, in millimetres.
    pub board: DVec2,
    pub camera: DVec2,
    /// W_c.
    pub camera_whitener: DMat2,
    pub lit: Option<LitObservation>,
    /// Whether the camera's observation is used (not an outlier).
    pub camera_counts: bool,
    /// Whether the projector's observation is used (exists and is not an outlier).
    pub projector_counts: bool,
}

/// Projector coordinates of a board point.
#[derive(Debug, Clone)]
pub(super) struct LitObservation {
    pub px: DVec2,
    pub slope: DMat2,
    /// W_p.
    pub whitener: DMat2,
}

/// The observations of a pose.
#[derive(Debug, Clone)]
pub(super) struct PoseObservations {
    pub name: String,
    /// Index of this pose in the caller's list of poses.
    pub given: usize,
    pub points: Vec<Observation>,
    /// Number of given points that cannot be used: their index is off the board, or their position
    /// or covariance is invalid.
    pub improper: usize,
}

impl PoseObservations {
    pub fn new(board: &Board, pose: &PoseSightings, given: usize) -> Self {
        let points: Vec<Observation> = pose
            .sightings
            .iter()
            .filter_map(|s| observation(board, s))
            .collect();
        Self {
            name: pose.name.clone(),
            given,
            improper: pose.sightings.len() - points.len(),
            points,
        }
    }

    /// Number of points with projector coordinates.
    pub fn lit(&self) -> usize {
        self.points.iter().filter(|p| p.lit.is_some()).count()
    }
}

fn observation(board: &Board, s: &Sighting) -> Option<Observation> {
    let [columns, rows] = board.grid();
    let [column, row] = s.index;
    if column >= columns || row >= rows || !s.camera_px.is_finite() {
        return None;
    }
    let lit = s.projector.and_then(|lit| {
        let proper = lit.px.is_finite() && lit.slope.is_finite();
        let whitener = whitener(lit.covariance)?;
        proper.then_some(LitObservation {
            px: lit.px,
            slope: lit.slope,
            whitener,
        })
    });
    Some(Observation {
        index: s.index,
        board: board.point(s.index),
        camera: s.camera_px,
        camera_whitener: whitener(s.camera_covariance)?,
        camera_counts: true,
        projector_counts: lit.is_some(),
        lit,
    })
}

/// Inverse of the lower Cholesky factor. Returns `None` if the matrix is not positive definite.
fn whitener(c: DMat2) -> Option<DMat2> {
    let (a, d) = (c.x_axis.x, c.y_axis.y);
    let off = 0.5 * (c.x_axis.y + c.y_axis.x);
    let first = a.sqrt();
    let lower = off / first;
    let second = (d - lower * lower).sqrt();
    let w = DMat2::from_cols(
        DVec2::new(1.0 / first, -lower / (first * second)),
        DVec2::new(0.0, 1.0 / second),
    );
    (c.is_finite() && a > 0.0 && second > 1e-7 * d.sqrt() && w.is_finite()).then_some(w)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whitener_whitens_and_refuses_invalid_covariance() {
        let c = DMat2::from_cols(DVec2::new(4.0, -1.5), DVec2::new(-1.5, 0.9));
        let w = whitener(c).unwrap();
        assert!((w * c * w.transpose() - DMat2::IDENTITY).abs_diff_eq(DMat2::ZERO, 1e-14));
        for bad in [
            DMat2::ZERO,
            DMat2::NAN,
            DMat2::from_cols_array(&[1.0, 2.0, 2.0, 1.0]),
            DMat2::from_cols_array(&[-1.0, 0.0, 0.0, 1.0]),
            DMat2::from_cols_array(&[f64::INFINITY, 0.0, 0.0, 1.0]),
        ] {
            assert!(whitener(bad).is_none(), "{bad}");
        }
    }
}
