//! Properties of the lenses of camera and projector: focus, veiling glare, and the check of their
//! distortion.

use phasmid_core::check::Check;
use phasmid_core::error::Result;
use phasmid_geometry::Lens;
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

pub(super) fn check_focus(f: &Focus, field: &str, check: &Check<'_>) -> Result<()> {
    check.within(&format!("{field}.distance_mm"), f.distance_mm, 1.0..=1e7)?;
    check.within(&format!("{field}.aperture_mm"), f.aperture_mm, 0.0..=1000.0)
}

/// Light that the lens scatters over the image, as in the halo around a bright source. ISO 9358
/// measures it as the veiling glare index: the fraction of a white field's light that falls on a
/// black hole.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Glare {
    /// Percentage of each point's light that is scattered.
    pub percent: f64,
    /// Standard deviation of the Gaussian scattering kernel in pixel widths, the same in every
    /// direction on the sensor. Light that would fall outside the image is reflected back into it,
    /// so that none is lost.
    pub sigma_px: f64,
}

pub(super) fn check_glare(glare: Glare, check: &Check<'_>) -> Result<()> {
    check.within("camera.glare.percent", glare.percent, 0.0..=100.0)?;
    check.within("camera.glare.sigma_px", glare.sigma_px, 32.0..=32768.0)
}

/// Rejects distortion coefficients for which the image folds over: some pixel would then have no
/// ray or two rays.
pub(super) fn check_distortion(lens: &Lens, field: &str, check: &Check<'_>) -> Result<()> {
    check.all_within(field, &lens.distortion, -1e3..=1e3)?;
    check.in_range()?;
    lens.folds_before().map_or(Ok(()), |px| {
        Err(check
            .source
            .violation(field, Lens::fold_found(px), Lens::FOLD_ALLOWED))
    })
}
