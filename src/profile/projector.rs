//! Projector of a profile: an inverse camera and its light.

use super::lens::{check_distortion, check_focus};
use super::{Focus, Led, PIXEL_ASPECT, Response, Timing, Vignetting};
use super::{led, response, timing, vignetting};
use glam::{DVec2, DVec3};
use phasmid_core::check::Check;
use phasmid_core::error::Result;
use phasmid_geometry::{Lens, Pose, View};
use phasmid_pattern::manifest::MAX_SIDE_PX;
use serde::{Deserialize, Serialize};

/// The projector, an inverse camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Projector {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Throw distance over image width.
    pub throw_ratio: f64,
    /// Width of a projected pixel over its height, 0.5 to 2, which is fy / fx of a calibration.
    #[serde(default = "square")]
    pub pixel_aspect: f64,
    /// Offset of the principal point from the image centre in pixels.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly")]
    pub lens_shift_px: [f64; 2],
    /// Position of the pupil in the rig's frame in millimetres.
    #[serde(deserialize_with = "phasmid_core::numbers::exactly")]
    pub position_mm: [f64; 3],
    /// Rotation in degrees about the fixed x, then y, then z axis of the rig.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly")]
    pub rotation_deg: [f64; 3],
    /// OpenCV's k1 k2 p1 p2 k3.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly")]
    pub distortion: [f64; 5],
    /// Bits per displayed level, 1 to 8.
    #[serde(default = "bits")]
    pub bits: u32,
    /// Radiant intensity of full white in watts per steradian, uniform over the field except for
    /// `vignetting`.
    #[serde(default = "radiant_intensity_w_sr")]
    pub radiant_intensity_w_sr: f64,
    /// Wavelength of the light in nanometres.
    #[serde(default = "wavelength_nm")]
    pub wavelength_nm: f64,
    /// Response of light to the displayed level; linear when absent.
    #[serde(default)]
    pub response: Option<Response>,
    /// Ratio of full white to full black (full on / full off, as in data sheets); black emits no
    /// light when absent.
    #[serde(default)]
    pub contrast_ratio: Option<f64>,
    /// Light falloff towards the edge of the field; none when absent.
    #[serde(default)]
    pub vignetting: Vignetting,
    /// Focus and aperture; sharp everywhere when absent.
    #[serde(default)]
    pub focus: Option<Focus>,
    /// Display timing; when absent, each pattern is shown immediately and for its whole period.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timing: Option<Timing>,
    /// Rise time and thermal droop; when absent, light rises instantly and does not droop.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub led: Option<Led>,
}

/// The aspect ratio of square pixels.
fn square() -> f64 {
    1.0
}

fn bits() -> u32 {
    8
}
/// The radiant intensity of about 100 lm of green light over 0.3 sr.
fn radiant_intensity_w_sr() -> f64 {
    0.5
}
fn wavelength_nm() -> f64 {
    550.0
}

impl Projector {
    /// Returns the light of a level from 0 to 2^bits - 1, relative to full white.
    pub fn light(&self, level: u16) -> f64 {
        let level = f64::from(level) / f64::from((1u32 << self.bits) - 1);
        let shown = self.response.as_ref().map_or(level, |r| r.light(level));
        let black = self.contrast_ratio.map_or(0.0, |ratio| 1.0 / ratio);
        black + (1.0 - black) * shown
    }

    /// Returns the intrinsics and pose of the inverse camera.
    pub fn view(&self) -> View {
        let focal_px = self.throw_ratio * f64::from(self.width_px);
        View {
            lens: Lens {
                width_px: self.width_px,
                height_px: self.height_px,
                focal_px: focal_px * DVec2::new(1.0, self.pixel_aspect),
                principal_px: DVec2::new(
                    (f64::from(self.width_px) - 1.0) / 2.0,
                    (f64::from(self.height_px) - 1.0) / 2.0,
                ) + DVec2::from_array(self.lens_shift_px),
                distortion: self.distortion,
            },
            rig_from_view: Pose::from_xyz_deg(
                DVec3::from_array(self.position_mm),
                DVec3::from_array(self.rotation_deg),
            ),
        }
    }
}

pub(super) fn check(p: &Projector, check: &Check<'_>) -> Result<()> {
    check.within("projector.width_px", p.width_px, 8..=MAX_SIDE_PX)?;
    check.within("projector.height_px", p.height_px, 8..=MAX_SIDE_PX)?;
    check.within("projector.throw_ratio", p.throw_ratio, 0.05..=100.0)?;
    check.within("projector.pixel_aspect", p.pixel_aspect, PIXEL_ASPECT)?;
    check.all_within("projector.lens_shift_px", &p.lens_shift_px, -1e5..=1e5)?;
    check.all_within("projector.position_mm", &p.position_mm, -1e7..=1e7)?;
    check.all_within("projector.rotation_deg", &p.rotation_deg, -360.0..=360.0)?;
    check.within("projector.bits", p.bits, 1..=8)?;
    check.within(
        "projector.radiant_intensity_w_sr",
        p.radiant_intensity_w_sr,
        0.0..=1e6,
    )?;
    check.within("projector.wavelength_nm", p.wavelength_nm, 300.0..=1100.0)?;
    if let Some(ratio) = p.contrast_ratio {
        check.within("projector.contrast_ratio", ratio, 1.0..=1e9)?;
    }
    if let Some(f) = &p.focus {
        check_focus(f, "projector.focus", check)?;
    }
    if let Some(curve) = &p.response {
        check.section(|check| response::check(curve, "projector.response", check));
    }
    if let Some(led) = &p.led {
        check.section(|check| led::check(led, check));
    }
    if let Some(t) = &p.timing {
        check.section(|check| timing::check(t, p.response.is_some(), check));
    }
    check.in_range()?;
    let baseline = p.view().center().length();
    check.that(
        baseline >= 1e-3,
        "projector.position_mm",
        format!("{baseline} mm from the camera (zero baseline)"),
        "at least 0.001 mm",
    )?;
    check_distortion(&p.view().lens, "projector.distortion", check)?;
    vignetting::check(&p.vignetting, &p.view().lens, "projector.vignetting", check)
}
