//! Accuracy of a calibration, computed by comparison with the truth.

use crate::calibration::desk::Desk;
use phasmid::calibrate::rig::Calibration;
use phasmid::calibrate::solve::chi_square_bound;
use phasmid::geometry::Pose;
use std::fmt;

/// Error figures of a calibration.
pub struct Figures {
    /// Number of poses that were used.
    pub poses: usize,
    /// Number of points that were used.
    pub points: usize,
    /// Root mean square distance of the dots' centres from the truth, in pixels of the camera.
    pub dots_px: f64,
    /// Root mean square of the distances of the dots' centres from the truth, divided by their
    /// standard deviations.
    pub dots_whitened: f64,
    /// Mean reprojection error of the camera in pixels.
    pub camera_px: f64,
    /// Mean reprojection error of the projector in pixels.
    pub projector_px: f64,
    /// Root mean square of the whitened residuals of camera and projector.
    pub whitened: [f64; 2],
    /// Root mean square of the normalised errors of the projector coordinates: each error, evaluated
    /// at the true position of a point, is divided by the coordinate's standard deviation.
    pub lit_whitened: f64,
    /// Root mean square of the errors of the projector's coordinates at the exact positions of the
    /// points, in projector pixels.
    pub lit_px: f64,
    /// Squared Mahalanobis distance of all parameters from the truth.
    pub distance: f64,
    /// Degrees of freedom of `distance`.
    pub freedom: usize,
    /// Squared Mahalanobis distance of the rig's parameters from the truth.
    pub rig_distance: f64,
    /// Degrees of freedom of `rig_distance`.
    pub rig_freedom: usize,
    variance_factor: f64,
    inflation: [f64; 2],
    rounds: usize,
    warnings: Vec<String>,
    parameters: Vec<String>,
}

impl Figures {
    /// Computes the figures; `poses` holds the true poses of all captures.
    pub fn new(desk: &Desk, calibration: &Calibration, poses: &[Pose]) -> Self {
        let solution = &calibration.solution;
        let (mut squares, mut whitened, mut points) = (0.0, 0.0, 0);
        let (mut lit_squares, mut lit_whitened, mut lit) = (0.0, 0.0, 0);
        for solved in &solution.poses {
            let pose = &poses[solved.given];
            for sighting in &calibration.sightings[solved.given].sightings {
                let point = pose.point(desk.board.point(sighting.index).extend(0.0));
                let off = sighting.camera_px - desk.rig.camera.project(point).unwrap();
                squares += off.length_squared();
                whitened += off.dot(sighting.camera_covariance.inverse() * off);
                points += 1;
                let Some(there) = sighting.projector else {
                    continue;
                };
                // Projector pixel at the exact point.
                let own = there.px - there.slope * off;
                let off = own - desk.rig.projector.project(point).unwrap();
                lit_squares += off.length_squared();
                lit_whitened += off.dot(there.covariance.inverse() * off);
                lit += 1;
            }
        }
        let used: Vec<Pose> = solution.poses.iter().map(|p| poses[p.given]).collect();
        let (distance, freedom) = solution.mahalanobis(&desk.rig, Some(&used));
        let (rig_distance, rig_freedom) = solution.mahalanobis(&desk.rig, None);
        let parameters = solution.parameters.iter().take(rig_freedom);
        Self {
            poses: solution.poses.len(),
            points,
            dots_px: (squares / points as f64).sqrt(),
            dots_whitened: (whitened / (2 * points) as f64).sqrt(),
            camera_px: solution.camera_errors.mean_px,
            projector_px: solution.projector_errors.mean_px,
            whitened: [
                solution.camera_errors.whitened_rms,
                solution.projector_errors.whitened_rms,
            ],
            lit_px: (lit_squares / lit as f64).sqrt(),
            lit_whitened: (lit_whitened / (2 * lit) as f64).sqrt(),
            distance,
            freedom,
            rig_distance,
            rig_freedom,
            variance_factor: solution.variance_factor,
            inflation: solution.inflation,
            rounds: calibration.rounds,
            warnings: calibration.warnings.clone(),
            parameters: parameters
                .map(|p| format!("{} = {:.4} +- {:.4} {}", p.name, p.value, p.sigma, p.unit))
                .collect(),
        }
    }
}

impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} poses, {} points, {} rounds",
            self.poses, self.points, self.rounds
        )?;
        writeln!(
            f,
            "dots {:.4} px RMS from the truth ({:.3} whitened); projector {:.4} px ({:.3} whitened)",
            self.dots_px, self.dots_whitened, self.lit_px, self.lit_whitened
        )?;
        writeln!(
            f,
            "reprojection, mean: camera {:.4} px, projector {:.4} px; whitened {:.3} and {:.3}; \
             variance factor {:.3}, inflation {:.3?}",
            self.camera_px,
            self.projector_px,
            self.whitened[0],
            self.whitened[1],
            self.variance_factor,
            self.inflation
        )?;
        writeln!(
            f,
            "Mahalanobis {:.1} of {} (99 %: {:.1}); the rig's own {:.1} of {} (99 %: {:.1})",
            self.distance,
            self.freedom,
            chi_square_bound(0.99, self.freedom),
            self.rig_distance,
            self.rig_freedom,
            chi_square_bound(0.99, self.rig_freedom)
        )?;
        writeln!(f, "{}", self.parameters.join("; "))?;
        write!(f, "{}", self.warnings.join("\n"))
    }
}
