//! What solving gives: the rig, the poses, and how well all of it is known.

use super::rotation::difference;
use glam::DVec2;
use nalgebra::{DMatrix, DVector};
use phasmid_geometry::{Pose, Rig};

/// A rig that was solved for.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// The rig; its frame is the camera's. Without a noise model: that is the caller's to add.
    pub rig: Rig,
    /// The poses that were used, in the order given.
    pub poses: Vec<SolvedPose>,
    /// The poses that were not, and why.
    pub left_out: Vec<LeftOut>,
    /// Which of k1, k2, p1, p2, k3 of the camera were estimated.
    pub camera_coefficients: [bool; 5],
    /// Which of k1, k2, p1, p2, k3 of the projector were estimated.
    pub projector_coefficients: [bool; 5],
    /// All that was estimated: the camera's lens, the projector's lens, the projector's pose, then
    /// six numbers for each used pose.
    pub parameters: Vec<Parameter>,
    /// Covariance of `parameters`, rows and columns in their order, in their units. Rotations are
    /// told as small turns in radians about the rig's axes: true = exp(turn) estimated.
    pub covariance: DMatrix<f64>,
    /// Sum of squares of the whitened residuals over the degrees of freedom, by the covariances as
    /// they were given; 1 where these are right.
    pub variance_factor: f64,
    /// What the given covariances of camera points and of projector coordinates were multiplied by
    /// because residuals were larger than they and chance allow: 1 or more. `covariance` has it in it.
    pub inflation: [f64; 2],
    /// Numbers that were observed (by points that were used) minus parameters.
    pub degrees_of_freedom: usize,
    /// Ratio of largest and smallest eigenvalue of the correlation matrix of the rig's parameters.
    pub condition: f64,
    /// Distances in camera pixels between points seen and points expected.
    pub camera_errors: Errors,
    /// Distances in projector pixels, plain: what a camera point's own error does is in them.
    pub projector_errors: Errors,
    /// What a user should know before trusting this, with numbers.
    pub warnings: Vec<String>,
}

/// Lengths of residuals.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Errors {
    /// How many points.
    pub count: usize,
    /// Mean length in pixels.
    pub mean_px: f64,
    /// Root of the mean square length in pixels.
    pub rms_px: f64,
    /// Largest length in pixels.
    pub max_px: f64,
    /// Root of the mean square of the whitened components: 1 where the covariances are right.
    pub whitened_rms: f64,
}

/// A pose that was used.
#[derive(Debug, Clone, PartialEq)]
pub struct SolvedPose {
    /// Its name.
    pub name: String,
    /// Its place in the list of poses that was given.
    pub given: usize,
    /// Takes coordinates on the board to the camera's frame (and the rig's), in millimetres.
    pub camera_from_board: Pose,
    /// Errors of its camera points.
    pub camera_errors: Errors,
    /// Errors of its projector coordinates.
    pub projector_errors: Errors,
    /// Its points, in the order given; points that could not be used at all are missing.
    pub points: Vec<PointResidual>,
}

/// A pose that was not used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOut {
    /// Its name.
    pub name: String,
    /// Its place in the list of poses that was given.
    pub given: usize,
    /// Why, with numbers.
    pub why: String,
}

/// How a point fits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointResidual {
    /// Column and row on the board.
    pub index: [u32; 2],
    /// Camera pixel seen minus the one expected.
    pub camera_px: DVec2,
    /// `camera_px` whitened by its covariance as given: components of variance 1.
    pub camera_whitened: DVec2,
    /// Whether the camera's part counts: 1, or 0 of an outlier.
    pub camera_weight: f64,
    /// The projector's part, where the projector lit the point.
    pub projector: Option<ProjectorResidual>,
}

/// How a point's projector coordinates fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProjectorResidual {
    /// Projector pixel decoded minus the one expected.
    pub px: DVec2,
    /// The part of `px` that the camera point's error does not explain, whitened by its covariance
    /// as given: components of variance 1.
    pub whitened: DVec2,
    /// Whether it counts: 1, or 0 of an outlier.
    pub weight: f64,
}

/// A number that was estimated.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// What it is: `camera.fx`, `projector.k1`, `projector.x`, `NAME.turn_x`.
    pub name: String,
    /// `px`, `mm`, `rad`, or nothing.
    pub unit: &'static str,
    /// Its value; of a turn: the component of the rotation vector.
    pub value: f64,
    /// Its standard deviation; of a turn: that of a small turn about the rig's axis.
    pub sigma: f64,
}

impl Solution {
    /// Squared Mahalanobis distance of the estimates from the true rig and, where given, the true
    /// poses of the boards (`camera_from_board`, one for each used pose, in their order), and its
    /// degrees of freedom: it follows a chi-square distribution where the covariance is honest; see
    /// [`chi_square_bound`](super::chi_square_bound). The true rig's frame may be any; distortion
    /// coefficients that were not estimated are not compared. NaN where the covariance has no
    /// inverse or the number of poses differs.
    pub fn mahalanobis(&self, truth: &Rig, boards: Option<&[Pose]>) -> (f64, usize) {
        let camera_from_rig = truth.camera.rig_from_view.inverse();
        let place = camera_from_rig * truth.projector.rig_from_view;
        let mut errors = Vec::new();
        for (own, other, estimated) in [
            (
                &self.rig.camera.lens,
                &truth.camera.lens,
                self.camera_coefficients,
            ),
            (
                &self.rig.projector.lens,
                &truth.projector.lens,
                self.projector_coefficients,
            ),
        ] {
            let (f, c) = (
                other.focal_px - own.focal_px,
                other.principal_px - own.principal_px,
            );
            errors.extend([f.x, f.y, c.x, c.y]);
            let coefficients = (0..5).filter(|i| estimated[*i]);
            errors.extend(coefficients.map(|i| other.distortion[i] - own.distortion[i]));
        }
        errors.extend(difference(&self.rig.projector.rig_from_view, &place));
        for (own, other) in self.poses.iter().zip(boards.unwrap_or_default()) {
            errors.extend(difference(&own.camera_from_board, other));
        }
        let dof = errors.len();
        let complete = boards.is_none_or(|b| b.len() == self.poses.len());
        if !complete || dof > self.covariance.nrows() {
            return (f64::NAN, dof);
        }
        // Scaled to unit variances, as units differ by orders of magnitude.
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
