//! What a residual costs, and which do not belong to the rest.
//!
//! On the way to the solution residuals cost by Huber's function (Huber, "Robust estimation of a
//! location parameter", 1964), which bounds what one point can do. At the solution a point counts or
//! it does not: one whose whitened residual is beyond a fixed threshold is left out, and what is
//! left is plain least squares, so that the covariance means what it says. Of honest points the
//! threshold leaves out four in a million.

use super::homography::median;
use super::model::{State, Whitened, residual};
use super::observation::PoseObservations;

/// Whitened length of two components beyond which a point is an outlier: exp(-5^2 / 2) = 4e-6.
pub(super) const OUTLYING: f64 = 5.0;
/// Where Huber's function turns from a parabola to a line.
const HUBER: f64 = 2.5;
/// Median length of two normal components, sqrt(2 ln 2).
pub(super) const MEDIAN: f64 = 1.177_410_022_515_474_7;

/// The cost of a whitened residual of two components, by group: camera, projector.
#[derive(Debug, Clone, Copy)]
pub(super) enum Loss {
    /// The square, over the group's inflation.
    Square([f64; 2]),
    /// Huber's function with these thresholds.
    Huber([f64; 2]),
}

impl Loss {
    /// Cost and weight of a squared length.
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

    /// Huber's function for residuals of these scales.
    pub fn huber(scales: [f64; 2]) -> Self {
        Self::Huber(scales.map(|s| HUBER * s))
    }
}

/// Typical whitened residuals of a pose's camera points and projector coordinates: 1 where the
/// covariances are right, and none where nothing counts.
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
    lengths.map(|mut l| (!l.is_empty()).then(|| median(&mut l) / MEDIAN))
}

/// The same over all poses, at least 1.
pub(super) fn scales(poses: &[PoseObservations], state: &State) -> [f64; 2] {
    let mut lengths = [Vec::new(), Vec::new()];
    for (i, pose) in poses.iter().enumerate() {
        for_each(pose, state, i, |_, w| {
            lengths[0].push(w.camera.length());
            lengths[1].extend(w.projector.map(|p| p.length()));
        });
    }
    lengths.map(|mut l| {
        if l.is_empty() {
            1.0
        } else {
            (median(&mut l) / MEDIAN).max(1.0)
        }
    })
}

/// Decides anew which observations count; whether any has changed.
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

/// Calls for each point of a pose, outliers too, with what it leaves.
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
