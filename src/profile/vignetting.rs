//! Vignetting: decrease of light from a lens's axis to the edge of its field.

use glam::DVec2;
use phasmid_core::check::Check;
use phasmid_core::error::Result;
use phasmid_geometry::Lens;
use serde::{Deserialize, Serialize};

/// Light attenuation factor that depends on the angle to the axis.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct Vignetting {
    /// Whether to apply natural vignetting, the cosine-fourth law for light on a flat sensor or
    /// screen (e.g. Ray: "Applied Photographic Optics"; Kingslake: "Illumination in Optical
    /// Images"). For a projector of constant radiant intensity, three of the four cosines are
    /// already accounted for.
    pub natural: bool,
    /// a2, a4, a6 of the factor 1 + a2 r^2 + a4 r^4 + a6 r^6, with r the distance from the
    /// principal point in the undistorted image, in half diagonals of the image (the "pa" model of
    /// the Lensfun database).
    #[serde(deserialize_with = "phasmid_core::numbers::exactly")]
    pub falloff: [f64; 3],
}

impl Vignetting {
    /// Returns whether the attenuation factor is 1 over the whole image.
    #[inline]
    pub fn is_none(&self) -> bool {
        !self.natural && self.falloff == [0.0; 3]
    }

    /// Returns the polynomial factor at r in half diagonals.
    #[inline]
    pub fn falloff_at(&self, r: f64) -> f64 {
        let [a2, a4, a6] = self.falloff;
        let s = r * r;
        1.0 + s * (a2 + s * (a4 + s * a6))
    }
}

/// Returns half of the image diagonal in ideal (undistorted, normalised) image coordinates.
pub fn half_diagonal(lens: &Lens) -> f64 {
    let size = DVec2::new(f64::from(lens.width_px), f64::from(lens.height_px));
    (size / lens.focal_px).length() / 2.0
}

pub(super) fn check(v: &Vignetting, lens: &Lens, field: &str, check: &Check<'_>) -> Result<()> {
    let field = format!("{field}.falloff");
    check.all_within(&field, &v.falloff, -100.0..=100.0)?;
    check.in_range()?;
    let (w, h) = (f64::from(lens.width_px), f64::from(lens.height_px));
    let far = [(0.0, 0.0), (w, 0.0), (0.0, h), (w, h)]
        .map(|c| lens.ray(DVec2::from(c) - 0.5).truncate().length())
        .into_iter()
        .fold(0.0, f64::max)
        / half_diagonal(lens);
    // 256 steps suffice for a cubic in r^2.
    for i in 0..=256 {
        let r = far * f64::from(i) / 256.0;
        let factor = v.falloff_at(r);
        check.that(
            (0.0..=10.0).contains(&factor),
            &field,
            format!("a factor of {factor:.3} at {r:.2} half diagonals"),
            "a factor of 0 to 10 over the whole image",
        )?;
    }
    Ok(())
}
