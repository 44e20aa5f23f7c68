//! Overlap of two solids: Dice's coefficient, volumes and centroids of closed meshes.
//!
//! Volume and centroid are exact, by the divergence theorem. The intersection is integrated over columns
//! along z: exactly along a column, from the heights at which it enters and leaves each solid, and by
//! the midpoint rule across the columns, which form a square grid. For smooth solids the error decreases
//! with the column width to the power of 3/2 or faster. Its size is estimated by comparing the columns'
//! volume of each solid with the exact volume, and returned with the result.
//!
//! [`PositionErrors`] are statistics of the position error of a target over several scans.

mod columns;
#[cfg(test)]
mod tests;

use columns::Columns;
use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::Mesh;
use serde::Serialize;

/// Default number of columns along the longer side of the grid of [`overlap`]. It gives an error
/// of 1e-4 in Dice's coefficient for solids like a tumour.
pub const OVERLAP_COLUMNS: usize = 256;

/// Overlap of two solids a and b, volumes in cubic millimetres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Overlap {
    /// Dice's coefficient, 2 |A and B| / (|A| + |B|): 0 for disjoint solids, 1 for equal solids (L.
    /// Dice, "Measures of the amount of ecologic association between species", 1945).
    pub dice: f64,
    /// Volume of a.
    pub a_mm3: f64,
    /// Volume of b.
    pub b_mm3: f64,
    /// Volume of the intersection.
    pub both_mm3: f64,
    /// Relative difference between the volume that the columns give and the exact volume, the larger of
    /// the two solids' differences: an estimate of the relative error of `dice` and `both_mm3`.
    pub error: f64,
}

/// Returns volume in cubic millimetres and centroid of a closed mesh with outward triangles, by
/// signed tetrahedra. A mesh without volume gets the mean of its vertices as centroid.
pub fn solid_moments(vertices: &[DVec3], triangles: &[[u32; 3]]) -> (f64, DVec3) {
    let count = vertices.len().max(1) as f64;
    // Use an origin near the solid to avoid cancellation.
    let middle = vertices.iter().sum::<DVec3>() / count;
    let (mut volume, mut moment) = (0.0, DVec3::ZERO);
    for t in triangles {
        let [a, b, c] = t.map(|i| vertices[i as usize] - middle);
        let sixth = a.dot(b.cross(c)) / 6.0;
        volume += sixth;
        moment += (a + b + c) * (sixth / 4.0);
    }
    if volume == 0.0 {
        return (0.0, middle);
    }
    (volume, middle + moment / volume)
}

/// Compares two closed meshes with outward triangles, in the same frame, on a grid of `columns` (8
/// to 4096) along its longer side.
///
/// # Errors
/// Returns an error if a mesh encloses no volume or `columns` is out of range.
pub fn overlap(a: &Mesh, b: &Mesh, columns: usize) -> Result<Overlap> {
    if !(8..=4096).contains(&columns) {
        return Err(Error::input("columns", columns, "8 to 4096"));
    }
    let mut volumes = [0.0; 2];
    for (k, mesh) in [a, b].into_iter().enumerate() {
        volumes[k] = solid_moments(&mesh.vertices, &mesh.triangles).0;
        if !(volumes[k] > 0.0) {
            return Err(Error::input(
                format!("mesh {}", ["a", "b"][k]),
                format!("a volume of {} mm3", volumes[k]),
                "a closed mesh whose triangles face outwards",
            ));
        }
    }
    let bounds = [a, b].map(|m| m.bounds().unwrap_or_default());
    let lo = bounds[0].0.min(bounds[1].0).truncate();
    let hi = bounds[0].1.max(bounds[1].1).truncate();
    let grid = Columns::over(lo, hi, columns);
    let (inside_a, inside_b) = (grid.spans(a), grid.spans(b));
    let (mut lengths, mut shared) = ([0.0; 2], 0.0);
    for (spans_a, spans_b) in inside_a.iter().zip(&inside_b) {
        for (sum, spans) in lengths.iter_mut().zip([spans_a, spans_b]) {
            *sum += spans.iter().map(|s| s[1] - s[0]).sum::<f64>();
        }
        for s in spans_a {
            for t in spans_b {
                shared += (s[1].min(t[1]) - s[0].max(t[0])).max(0.0);
            }
        }
    }
    let area = grid.area_mm2();
    let [sampled_a, sampled_b] = lengths.map(|l| l * area);
    let error = ((sampled_a / volumes[0] - 1.0).abs()).max((sampled_b / volumes[1] - 1.0).abs());
    Ok(Overlap {
        // All three volumes are summed over the same columns, so that their common errors cancel.
        dice: 2.0 * shared * area / (sampled_a + sampled_b),
        a_mm3: volumes[0],
        b_mm3: volumes[1],
        both_mm3: shared * area,
        error,
    })
}

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
