//! How to track a pose.

/// What a tracker does and believes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigidOptions {
    /// Steps at most.
    pub max_iterations: usize,
    /// Done when a step moves the region's points by less than this, RMS, in millimetres.
    pub step_mm: f64,
    /// Points farther from the surface than this take no part, in millimetres.
    pub capture_mm: f64,
    /// A motion whose expected deviation (RMS displacement of the region's points) is larger is
    /// not determined, in millimetres.
    pub tolerance_mm: f64,
    /// Range, as a standard deviation in millimetres, in which an undetermined motion may be.
    pub range_mm: f64,
    /// Errors of points nearer to each other than about this go together, in millimetres: they are
    /// taken as a field with the correlation exp(-d^2 / 2 l^2), in which a mean over an area holds as
    /// much as one point in 2 pi l^2. It makes variances larger by 1 + 2 pi l^2 times the density of
    /// the points; 0 for white noise.
    pub correlation_mm: f64,
    /// Deviation along each axis of the offset that calibration leaves in all points of a pod, in
    /// millimetres.
    pub pod_sd_mm: f64,
    /// Points over the region below which nothing is said.
    pub least_points: usize,
    /// Share of the region's area that a scan should cover.
    pub least_coverage: f64,
    /// Spread of the residuals in units of their deviations above which a surface does not fit.
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
