//! How to follow a motion.

/// What is known of a patient's set-up beside the breathing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SetUp {
    /// Deviation of the patient's place along each axis, in millimetres.
    pub shift_sd_mm: f64,
    /// Deviation of the rotation vector along each axis, in degrees.
    pub turn_sd_deg: f64,
}

/// What a fit does and believes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitOptions {
    /// Steps at most.
    pub max_iterations: usize,
    /// Done when no coefficient changes by more than this part of a deviation, and the patient by no
    /// more than this in millimetres.
    pub step: f64,
    /// Points farther from the surface than this take no part, in millimetres.
    pub capture_mm: f64,
    /// Prior deviation of coefficients, in those of planning: patients breathe deeper on one day
    /// than on another.
    pub prior: f64,
    /// Whether the patient's pose is fitted too, and what is known of it; `None` leaves it as given.
    pub set_up: Option<SetUp>,
    /// As in [`RigidOptions`](super::super::RigidOptions): below about this distance, in
    /// millimetres, errors of points go together.
    pub correlation_mm: f64,
    /// Points over the region below which nothing is said.
    pub least_points: usize,
    /// Share of the region's area that a scan should cover.
    pub least_coverage: f64,
    /// Spread of the residuals in units of their deviations above which the surface does not fit.
    pub misfit: f64,
    /// Coefficients beyond so many deviations of planning are outside of the model.
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
