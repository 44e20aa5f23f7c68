//! Result of the solver: the rig, the poses, and their uncertainty.

use super::Unfit;
use super::coefficients::free;
use nalgebra::{DMatrix, DVector};
use phasmid_geometry::rotation::difference;
use phasmid_geometry::{Pose, Rig};

/// A calibrated rig with its board poses, covariance and residuals.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// The rig, in the camera's frame, with the covariance of its parameters if it is positive
    /// definite to rounding. It has no noise model; the caller adds it.
    pub rig: Rig,
    /// The poses that were used, in the given order.
    pub poses: Vec<SolvedPose>,
    /// The poses that were excluded, with reasons.
    pub left_out: Vec<LeftOut>,
    /// Which of the camera's k1, k2, p1, p2, k3 were estimated.
    pub camera_coefficients: [bool; 5],
    /// Which of the projector's k1, k2, p1, p2, k3 were estimated.
    pub projector_coefficients: [bool; 5],
    /// All estimated parameters: the camera's lens, the projector's lens, the projector's pose,
    /// then six numbers for each used pose.
    pub parameters: Vec<Parameter>,
    #[doc(hidden)]
    pub covariance: DMatrix<f64>,
    /// Sum of squared whitened residuals, using the given covariances, over the degrees of freedom.
    /// It is about 1 if the given covariances are right.
    pub variance_factor: f64,
    /// Factors, at least 1, by which the given covariances of camera points and of projector
    /// coordinates were multiplied because the residuals exceed them by more than chance.
    /// `covariance` is computed with these factors.
    pub inflation: [f64; 2],
    /// Number of scalar observations (of the points used) minus number of parameters.
    pub degrees_of_freedom: usize,
    /// Condition number of the correlation matrix of the rig's parameters.
    pub condition: f64,
    /// Distances between observed and predicted points, in camera pixels.
    pub camera_errors: Errors,
    /// Distances between decoded and predicted coordinates, in projector pixels. They include
    /// errors that the coordinates inherit from the camera points.
    pub projector_errors: Errors,
    /// Warnings about the reliability of the result, with numbers.
    pub warnings: Vec<String>,
}

/// Statistics of residual lengths.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Errors {
    /// Number of points.
    pub count: usize,
    /// Mean length in pixels.
    pub mean_px: f64,
    /// RMS length in pixels.
    pub rms_px: f64,
    /// Maximum length in pixels.
    pub max_px: f64,
    /// RMS of the whitened components: about 1 if the covariances are right.
    pub whitened_rms: f64,
}

/// A pose that was used.
#[derive(Debug, Clone, PartialEq)]
pub struct SolvedPose {
    /// Its name.
    pub name: String,
    /// Index in the given list of poses.
    pub given: usize,
    /// Transforms board coordinates to the camera's (and the rig's) frame, in millimetres.
    pub camera_from_board: Pose,
    /// Residual statistics of its camera points.
    pub camera_errors: Errors,
    /// Residual statistics of its projector coordinates.
    pub projector_errors: Errors,
    /// Its points in the given order, except points without a valid index or covariance.
    pub points: Vec<PointResidual>,
}

impl SolvedPose {
    /// Returns the angle between the board's normal and the line of sight to its origin (its middle), in
    /// degrees.
    pub fn tilt_deg(&self) -> f64 {
        let pose = &self.camera_from_board;
        let sight = pose.translation_mm.normalize_or_zero();
        let cosine = pose.rotation.z_axis.dot(sight);
        cosine.clamp(-1.0, 1.0).acos().to_degrees()
    }
}

/// A pose that was excluded.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOut {
    /// Its name.
    pub name: String,
    /// Index in the given list of poses.
    pub given: usize,
    /// Reason.
    pub why: Unfit,
}

/// Residuals of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointResidual {
    /// Column and row on the board.
    pub index: [u32; 2],
    /// Observed minus predicted camera pixel.
    pub camera_px: [f64; 2],
    /// `camera_px` whitened with the given covariance of the camera point: components of variance
    /// 1.
    pub camera_whitened: [f64; 2],
    /// 1 if the camera's observation is used, 0 if it is an outlier.
    pub camera_weight: f64,
    /// The projector's residual; `None` if the point has no projector coordinate.
    pub projector: Option<ProjectorResidual>,
}

/// Residuals of a point's projector coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProjectorResidual {
    /// Decoded minus predicted projector pixel.
    pub px: [f64; 2],
    /// `px` without the contribution of the camera point's residual, whitened with the given
    /// covariance of the coordinate: components of variance 1.
    pub whitened: [f64; 2],
    /// 1 if the observation is used, 0 if it is an outlier.
    pub weight: f64,
}

/// An estimated parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Name: `camera.fx`, `projector.k1`, `projector.x`, `NAME.turn_x`.
    pub name: String,
    /// `px`, `mm`, `rad`, or empty.
    pub unit: &'static str,
    /// Value. For a rotation, a component of the rotation vector.
    pub value: f64,
    /// Standard deviation. For a rotation, that of a small rotation about the corresponding axis of
    /// the rig's frame.
    pub sigma: f64,
}

impl Solution {
    /// Returns the covariance of two of `parameters` by their indices, in their units. Rotation errors
    /// are small rotation vectors in radians about the axes of the rig's frame: true rotation =
    /// exp(vector) * estimated rotation.
    ///
    /// # Panics
    /// Panics if an index is beyond `parameters`.
    pub fn covariance_of(&self, i: usize, j: usize) -> f64 {
        self.covariance[(i, j)]
    }

    /// Computes the squared Mahalanobis distance of the estimates from the true rig and, if given,
    /// the true poses of the boards (`camera_from_board`, one for each used pose, in their order).
    /// Returns it with its degrees of freedom.
    ///
    /// If the covariance is right, the distance follows a chi-square distribution; see
    /// [`chi_square_bound`](super::chi_square_bound). The true rig may be given in any frame.
    /// Distortion coefficients that were not estimated are not compared. The distance is NaN if the
    /// covariance is singular or the number of poses differs.
    pub fn mahalanobis(&self, truth: &Rig, boards: Option<&[Pose]>) -> (f64, usize) {
        let estimated = free(&[self.camera_coefficients, self.projector_coefficients]);
        let step = self.rig.step_to(truth);
        let of_rig = step.into_iter().zip(estimated).filter(|(_, e)| *e);
        let mut errors: Vec<f64> = of_rig.map(|(step, _)| step).collect();
        for (own, other) in self.poses.iter().zip(boards.unwrap_or_default()) {
            errors.extend(difference(&own.camera_from_board, other));
        }
        let dof = errors.len();
        let complete = boards.is_none_or(|b| b.len() == self.poses.len());
        if !complete || dof > self.covariance.nrows() {
            return (f64::NAN, dof);
        }
        // Scale to unit variances, because the units differ by orders of magnitude.
        let sigma: Vec<f64> = (0..dof).map(|i| self.covariance[(i, i)].sqrt()).collect();
        let correlation = DMatrix::from_fn(dof, dof, |i, j| {
            self.covariance[(i, j)] / (sigma[i] * sigma[j])
        });
        let error = DVector::from_fn(dof, |i, _| errors[i] / sigma[i]);
        let square = correlation
            .cholesky()
            .map_or(f64::NAN, |c| error.dot(&c.solve(&error)));
        (square, dof)
    }
}
