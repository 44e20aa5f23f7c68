//! Focus distance and aperture of a lens, which determine its defocus blur.

use phasmid_core::check::Check;
use phasmid_core::error::Result;
use serde::{Deserialize, Serialize};

/// Focus and aperture of a thin lens.
///
/// A point out of focus is spread over a disc. Its diameter on the focal plane is aperture |z -
/// distance| / z, hence focal_px aperture |1/distance - 1/z| in image pixels for a focal length of
/// `focal_px` (similar triangles; see the depth of field in any optics textbook, e.g. Hecht:
/// "Optics").
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Focus {
    /// Distance of sharp focus along the axis in millimetres.
    pub distance_mm: f64,
    /// Aperture diameter in millimetres: focal length over f-number. 0 is a pinhole.
    pub aperture_mm: f64,
}

pub(super) fn check(f: &Focus, field: &str, check: &Check<'_>) -> Result<()> {
    check.within(&format!("{field}.distance_mm"), f.distance_mm, 1.0..=1e7)?;
    check.within(&format!("{field}.aperture_mm"), f.aperture_mm, 0.0..=1000.0)
}
