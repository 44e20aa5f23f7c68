//! Where a lens is sharp, and how fast it blurs elsewhere.

use phasmid_core::check::Check;
use phasmid_core::error::Result;
use serde::{Deserialize, Serialize};

/// Focus and aperture of a thin lens.
///
/// Off the focused distance a point is spread over a disc. Seen on the focused plane its diameter
/// is aperture |z - distance| / z, so in pixels of an image of `focal_px` it is
/// focal_px aperture |1/distance - 1/z| (similar triangles; any textbook of optics, e.g. Hecht:
/// "Optics", on the depth of field).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Focus {
    /// Distance of sharp focus along the axis in millimetres.
    pub distance_mm: f64,
    /// Diameter of the lens's aperture in millimetres: focal length over f-number. 0 is a pinhole.
    pub aperture_mm: f64,
}

pub(super) fn check(f: &Focus, field: &str, check: &Check<'_>) -> Result<()> {
    check.within(&format!("{field}.distance_mm"), f.distance_mm, 1.0..=1e7)?;
    check.within(&format!("{field}.aperture_mm"), f.aperture_mm, 0.0..=1000.0)
}
