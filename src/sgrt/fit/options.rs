//! Settings of the motion fit.

/// Prior on the patient's set-up pose, fitted together with the breathing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SetUp {
    /// Standard deviation of the patient's position along each axis, in millimetres.
    pub shift_sd_mm: f64,
    /// Standard deviation of the rotation vector along each axis, in degrees.
    pub turn_sd_deg: f64,
}

/// Settings of [`MotionTracker`](super::MotionTracker).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitOptions {
    /// Maximum number of steps.
    pub max_iterations: usize,
    /// Convergence threshold: maximum change in one step, in standard deviations for coefficients,
    /// millimetres for the shift and radians for the turn.
    pub step: f64,
    /// Points farther from the surface than this are ignored, in millimetres.
    pub capture_mm: f64,
    /// Prior standard deviation of the coefficients, in units of their standard deviation over
    /// planning: breathing depth varies from day to day.
    pub prior: f64,
    /// Prior of the patient's pose, which is then fitted too; `None` keeps the start pose.
    pub set_up: Option<SetUp>,
    /// Correlation length of the points' errors in millimetres, as in
    /// [`RigidOptions`](super::super::RigidOptions).
    pub correlation_mm: f64,
    /// Minimum number of points over the region; with fewer, the fit fails.
    pub least_points: usize,
    /// Fraction of the region's area that a scan should cover; below it the result has a warning.
    pub least_coverage: f64,
    /// Scale of the residuals, in units of their standard deviations, above which a misfit is
    /// reported.
    pub misfit: f64,
    /// Coefficients above this many standard deviations of planning are reported as outside the
    /// model.
    pub outside: f64,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            max_iterations: 15,
            step: 2e-3,
            capture_mm: 40.0,
            prior: 2.0,
            set_up: None,
            correlation_mm: 1.0,
            least_points: 60,
            least_coverage: 0.3,
            misfit: 3.0,
            outside: 4.0,
        }
    }
}
