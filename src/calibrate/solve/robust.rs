//! Robust loss and outlier rejection.
//!
//! Far from the solution residuals are weighted by Huber's function (Huber, "Robust estimation of a
//! location parameter", 1964), which bounds the influence of a single point. At the solution,
//! points with a whitened residual beyond a fixed threshold are rejected and the rest is fitted by
//! plain least squares, so that the covariance is valid. With correct covariances the threshold
//! rejects four good points in a million.

use super::model::{State, Whitened, residual};
use super::observation::PoseObservations;
use phasmid_core::statistics::median;

/// Whitened length (of two components) beyond which a point is an outlier: exp(-5^2 / 2) = 4e-6.
const OUTLYING: f64 = 5.0;
/// Whitened length at which Huber's function changes from quadratic to linear.
const HUBER: f64 = 2.5;
/// Median length of a vector of two standard normal components, sqrt(2 ln 2).
const MEDIAN: f64 = 1.177_410_022_515_474_7;

/// Maximum robust scale of a pose relative to the median pose. At this scale half of the pose's
/// points are beyond the outlier threshold.
pub(super) const OUTLYING_POSE: f64 = OUTLYING / MEDIAN;

/// Loss as a function of a whitened residual with two components. Each array holds a value for the
/// camera and a value for the projector.
#[derive(Debug, Clone, Copy)]
pub(super) enum Loss {
    /// Squared length divided by the group's variance inflation.
    Square([f64; 2]),
    /// Huber's function with these thresholds.
    Huber([f64; 2]),
}

impl Loss {
    /// Returns loss and weight for a squared length; `group` is 0 for the camera, 1 for the
    /// projector.
    pub fn of(&self, group: usize, square: f64) -> (f64, f64) {
        match self {
            Self::Square(inflation) => (square / inflation[group], 1.0 / inflation[group]),
            Self::Huber(limits) => {
                let (k, length) = (limits[group], square.sqrt());
                if length <= k {
                    (square, 1.0)
                } else {
                    (k * (2.0 * length - k), k / length)
                }
            }
        }
    }

    /// Huber's function with thresholds for residuals of these scales.
    pub fn huber(scales: [f64; 2]) -> Self {
        Self::Huber(scales.map(|s| HUBER * s))
    }
}

/// Robust scale (from the median) of the whitened residuals of a pose's camera points and projector
/// coordinates: 1 if the covariances are right, `None` without any residuals.
pub(super) fn pose_scales(
    pose: &PoseObservations,
    state: &State,
    board: usize,
) -> [Option<f64>; 2] {
    let mut lengths = [Vec::new(), Vec::new()];
    for_each(pose, state, board, |_, w| {
        lengths[0].push(w.camera.length());
        lengths[1].extend(w.projector.map(|p| p.length()));
    });
    lengths.map(|mut l| Some(median(&mut l)? / MEDIAN))
}

/// Robust scales over the points of all poses, at least 1.
pub(super) fn scales(poses: &[PoseObservations], state: &State) -> [f64; 2] {
    let mut lengths = [Vec::new(), Vec::new()];
    for (i, pose) in poses.iter().enumerate() {
        for_each(pose, state, i, |_, w| {
            lengths[0].push(w.camera.length());
            lengths[1].extend(w.projector.map(|p| p.length()));
        });
    }
    lengths.map(|mut l| median(&mut l).map_or(1.0, |median| (median / MEDIAN).max(1.0)))
}

/// Reclassifies all observations as inliers or outliers. Returns whether any classification
/// changed.
pub(super) fn reject(poses: &mut [PoseObservations], state: &State) -> bool {
    let limits = scales(poses, state).map(|s| OUTLYING * s);
    let mut changed = false;
    for (i, pose) in poses.iter_mut().enumerate() {
        for o in &mut pose.points {
            let w = residual(o, state, i).map(|r| r.whitened(o));
            let camera = w.is_some_and(|w| w.camera.length() <= limits[0]);
            let projector = w
                .and_then(|w| w.projector)
                .is_some_and(|p| p.length() <= limits[1]);
            changed |= camera != o.camera_counts || projector != o.projector_counts;
            (o.camera_counts, o.projector_counts) = (camera, projector);
        }
    }
    changed
}

/// Calls `each` with the index and whitened residuals of every point of a pose, outliers included.
fn for_each(
    pose: &PoseObservations,
    state: &State,
    board: usize,
    mut each: impl FnMut(usize, Whitened),
) {
    for (i, o) in pose.points.iter().enumerate() {
        if let Some(r) = residual(o, state, board) {
            each(i, r.whitened(o));
        }
    }
}
