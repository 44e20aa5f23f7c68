//! Settings of rigid tracking.

/// Settings of [`track_rigid`](super::track_rigid).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigidOptions {
    /// Maximum number of steps.
    pub max_iterations: usize,
    /// Convergence threshold: RMS displacement of the region's points in one step, in millimetres.
    pub step_mm: f64,
    /// Points farther from the surface than this are ignored, in millimetres.
    pub capture_mm: f64,
    /// A motion is undetermined if its expected standard deviation (RMS displacement of the region's
    /// points) exceeds this, in millimetres.
    pub tolerance_mm: f64,
    /// Standard deviation assigned to an undetermined motion, in millimetres.
    pub range_mm: f64,
    /// Correlation length l of the points' errors, in millimetres; 0 for white noise. With the
    /// correlation exp(-d^2 / 2 l^2), the mean over an area carries as much information as one point
    /// per 2 pi l^2, so variances grow by the factor 1 + 2 pi l^2 times the density of the points.
    pub correlation_mm: f64,
    /// Standard deviation along each axis, in millimetres, of the common offset of a pod's points
    /// that calibration leaves.
    pub pod_sd_mm: f64,
    /// Minimum number of points over the region; with fewer, tracking fails.
    pub least_points: usize,
    /// Fraction of the region's area that a scan should cover; below it the result has a warning.
    pub least_coverage: f64,
    /// Scale of the residuals, in units of their standard deviations, above which a misfit is
    /// reported.
    pub misfit: f64,
}

impl Default for RigidOptions {
    fn default() -> Self {
        Self {
            max_iterations: 40,
            step_mm: 5e-4,
            capture_mm: 60.0,
            tolerance_mm: 0.5,
            range_mm: 50.0,
            correlation_mm: 1.0,
            pod_sd_mm: 0.0,
            least_points: 60,
            least_coverage: 0.3,
            misfit: 3.0,
        }
    }
}
