//! Statistics of the position error of a target over several scans.

use glam::DVec3;
use serde::Serialize;

/// Position error of a target in one scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetError {
    /// Estimate minus truth, in millimetres along the room's axes (LAT, LNG, VRT).
    pub error_mm: DVec3,
}

/// Errors over several scans, in millimetres. The target position error of a scan is the distance
/// between the centroids of the estimated and the true target.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PositionErrors {
    /// Number of scans.
    pub scans: usize,
    /// Mean distance.
    pub mean_mm: f64,
    /// Root of the mean squared distance.
    pub rms_mm: f64,
    /// 95th percentile of the distance, by the nearest rank.
    pub p95_mm: f64,
    /// Largest distance.
    pub max_mm: f64,
    /// Mean error along LAT, LNG and VRT.
    pub bias_mm: [f64; 3],
    /// Standard deviation about that mean along LAT, LNG and VRT.
    pub deviation_mm: [f64; 3],
}

impl PositionErrors {
    /// Computes the statistics; `None` without scans.
    pub fn of(errors: &[TargetError]) -> Option<Self> {
        if errors.is_empty() {
            return None;
        }
        let n = errors.len() as f64;
        let mut distances: Vec<f64> = errors.iter().map(|e| e.error_mm.length()).collect();
        // Sum in order of size, so that the result does not depend on the order of the scans.
        distances.sort_unstable_by(f64::total_cmp);
        let bias = errors.iter().map(|e| e.error_mm).sum::<DVec3>() / n;
        let squares = |e: &TargetError| (e.error_mm - bias) * (e.error_mm - bias);
        let variance = errors.iter().map(squares).sum::<DVec3>() / n;
        Some(Self {
            scans: errors.len(),
            mean_mm: distances.iter().sum::<f64>() / n,
            rms_mm: (distances.iter().map(|d| d * d).sum::<f64>() / n).sqrt(),
            p95_mm: distances[(0.95 * n).ceil() as usize - 1],
            max_mm: distances[errors.len() - 1],
            bias_mm: bias.to_array(),
            deviation_mm: variance.map(f64::sqrt).to_array(),
        })
    }
}
