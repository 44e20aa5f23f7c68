//! A calibrated rig: one camera, one projector and their poses. A calibration file holds a rig, a
//! device reports its nominal rig, and the decoder triangulates with it.

mod covariance;
pub mod parameters;
mod prediction;

pub use covariance::Covariance;

use crate::{Lens, Pose, Vector2, Vector3};
use glam::{DVec2, DVec3};
use phasmid_core::error::Result;
use phasmid_core::source::TomlSource;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A camera or projector and its pose in the rig's frame (that of camera 0: x right, y down, z
/// forward).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct View {
    /// Intrinsics.
    pub lens: Lens,
    /// Maps coordinates in the view's frame to the rig's frame, in millimetres.
    pub rig_from_view: Pose,
}

impl View {
    /// Returns the pupil (projection centre) in the rig's frame, in millimetres.
    pub fn center_mm(&self) -> [f64; 3] {
        self.center().to_array()
    }

    #[doc(hidden)]
    #[inline]
    pub fn center(&self) -> DVec3 {
        self.rig_from_view.translation_mm
    }

    /// Returns the pixel of a point in the rig's frame, in millimetres; `None` where [`Lens::project`]
    /// returns `None`.
    #[inline]
    pub fn project<V: Vector3>(&self, p: V) -> Option<V::Image> {
        let local = self.rig_from_view.rotation.transpose() * (p.to_glam() - self.center());
        self.lens.project(local).map(V::Image::from_glam)
    }

    /// Returns the direction in the rig's frame of the ray through a pixel; its z in the view's
    /// frame is 1.
    #[inline]
    pub fn ray<V: Vector2>(&self, px: V) -> V::Space {
        self.rig_from_view.direction(self.lens.ray(px))
    }
}

/// A camera's noise as known to the host, in digital numbers (DN), by the linear model of EMVA 1288
/// release 4.0, equation 13: variance = read^2 + 1/12 + gain (mean - black).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseModel {
    /// System gain K in DN per electron.
    pub gain_dn_per_e: f64,
    /// Standard deviation of the dark signal in DN, without the quantisation variance of 1/12.
    pub read_noise_dn: f64,
    /// Mean dark signal in DN.
    pub black_level_dn: f64,
    /// Signal at and above which a pixel counts as saturated, in DN.
    pub saturation_dn: f64,
}

impl NoiseModel {
    fn check(&self) -> Result<(), (&'static str, f64)> {
        [
            ("gain_dn_per_e", self.gain_dn_per_e),
            ("read_noise_dn", self.read_noise_dn),
            ("black_level_dn", self.black_level_dn),
            ("saturation_dn", self.saturation_dn),
        ]
        .into_iter()
        .find(|(_, value)| !(value.is_finite() && *value >= 0.0))
        .map_or(Ok(()), Err)
    }

    /// Returns the variance in DN^2 of a pixel with this mean signal in DN, including quantisation.
    #[inline]
    pub fn variance_dn2(&self, mean_dn: f64) -> f64 {
        self.read_noise_dn.powi(2)
            + 1.0 / 12.0
            + self.gain_dn_per_e * (mean_dn - self.black_level_dn).max(0.0)
    }
}

/// A calibration, as stored in a file or reported by a device.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rig {
    /// The camera.
    pub camera: View,
    /// The projector.
    pub projector: View,
    /// The camera's noise model, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<NoiseModel>,
    /// Covariance of the calibration, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<Covariance>,
}

impl Rig {
    /// Reads a calibration file.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read or [`Self::from_toml`] rejects it.
    pub fn read(path: &Path) -> Result<Self> {
        Self::from_source(&TomlSource::read(path)?)
    }

    /// Parses a calibration in TOML; `place` names the file or device in messages.
    ///
    /// # Errors
    /// Returns an error if the text does not match the schema or [`Self::check`] rejects a value.
    pub fn from_toml(text: &str, place: &str) -> Result<Self> {
        Self::from_source(&TomlSource::new(text, place))
    }

    fn from_source(source: &TomlSource) -> Result<Self> {
        let rig: Self = source.deserialize()?;
        rig.check()
            .map_err(|v| source.violation(&v.field, v.found, v.allowed))?;
        Ok(rig)
    }

    /// Checks that all values are physically possible.
    ///
    /// # Errors
    /// Returns the first field with an invalid value.
    pub fn check(&self) -> Result<(), Violation> {
        let violation = |field: String, found, allowed| Violation {
            field,
            found,
            allowed,
        };
        for (name, view) in [("camera", &self.camera), ("projector", &self.projector)] {
            view.check().map_err(|(field, found, allowed)| {
                violation(format!("{name}.{field}"), found, allowed)
            })?;
        }
        if (self.camera.center() - self.projector.center()).length() < 1e-6 {
            return Err(violation(
                "projector.rig_from_view.translation_mm".to_owned(),
                "the camera's own position (zero baseline)".to_owned(),
                "a projector at another place than the camera",
            ));
        }
        if let Some(noise) = &self.noise {
            noise.check().map_err(|(field, found)| {
                violation(
                    format!("noise.{field}"),
                    found.to_string(),
                    "a finite number, 0 or more",
                )
            })?;
        }
        Ok(())
    }

    /// Returns the depth, in mm in the camera's frame, at which the rays through the centres of the
    /// two images are closest. Returns `None` if that point is not in front of both.
    pub fn meeting_mm(&self) -> Option<f64> {
        let [seen, lit] = [&self.camera, &self.projector].map(|view| {
            let lens = &view.lens;
            let size = DVec2::new(lens.width_px.into(), lens.height_px.into());
            view.ray((size - 1.0) / 2.0)
        });
        let between = self.projector.center() - self.camera.center();
        // The points s * seen and between + t * lit are closest where their difference is perpendicular
        // to both rays. The first ray's z in the camera's frame is 1, so s is the depth.
        let across = seen.cross(lit);
        let square = across.length_squared();
        let s = between.cross(lit).dot(across) / square;
        let t = between.cross(seen).dot(across) / square;
        let parallel = square <= 1e-9 * seen.length_squared() * lit.length_squared();
        (!parallel && s > 0.0 && t > 0.0 && s.is_finite()).then_some(s)
    }

    /// Returns the calibration as TOML.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("numbers and tables always serialise")
    }
}

/// A field of a rig with an invalid value.
#[derive(Debug, Clone, PartialEq)]
pub struct Violation {
    /// Field path, such as `camera.lens.focal_px`.
    pub field: String,
    /// Value found.
    pub found: String,
    /// Allowed values.
    pub allowed: &'static str,
}

impl View {
    fn check(&self) -> Result<(), (&'static str, String, &'static str)> {
        let Lens {
            width_px,
            height_px,
            focal_px,
            principal_px,
            distortion,
        } = self.lens;
        let sizes = 1..=32768;
        if !sizes.contains(&width_px) || !sizes.contains(&height_px) {
            return Err((
                "lens.width_px",
                format!("{width_px} x {height_px}"),
                "1 to 32768 each",
            ));
        }
        if !(focal_px.is_finite() && focal_px.min_element() > 0.0) {
            return Err((
                "lens.focal_px",
                focal_px.to_string(),
                "finite numbers above 0",
            ));
        }
        if !principal_px.is_finite() || distortion.iter().any(|k| !k.is_finite()) {
            return Err((
                "lens.principal_px",
                format!("{principal_px}, {distortion:?}"),
                "finite numbers",
            ));
        }
        if let Some(px) = self.lens.folds_before() {
            return Err(("lens.distortion", Lens::fold_found(px), Lens::FOLD_ALLOWED));
        }
        let r = self.rig_from_view.rotation;
        let off = r * r.transpose() - glam::DMat3::IDENTITY;
        let worst = off
            .to_cols_array()
            .iter()
            .fold(0.0_f64, |m, x| m.max(x.abs()));
        if !(r.is_finite() && worst < 1e-6 && r.determinant() > 0.0) {
            return Err((
                "rig_from_view.rotation",
                format!("a matrix {worst:.1e} away from a rotation"),
                "orthonormal rows to 1e-6, determinant +1",
            ));
        }
        if !self.center().is_finite() {
            return Err((
                "rig_from_view.translation_mm",
                self.center().to_string(),
                "finite numbers",
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text() -> &'static str {
        crate::nominal::text("pmp-bench")
    }

    #[test]
    fn calibration_is_written_as_it_was_read() {
        let rig = Rig::from_toml(text(), "c.toml").unwrap();
        assert_eq!(rig.to_toml(), text());
        assert_eq!(rig.projector.center(), DVec3::new(400.0, 0.0, 0.0));
    }

    #[test]
    fn impossible_rigs_are_refused_with_their_line() {
        for (from, to, needle) in [
            ("[400.0, 0.0, 0.0]", "[0.0, 0.0, 0.0]", "zero baseline"),
            (
                "width_px = 1138",
                "width_px = 0",
                "c.toml:2: camera.lens.width_px",
            ),
            ("[1.0, 0.0, 0.0]", "[1.0, 0.1, 0.0]", "away from a rotation"),
            (
                "read_noise_dn = ",
                "read_noise_dn = -",
                "noise.read_noise_dn",
            ),
            ("[camera.lens]", "[camera.lens]\nblur = 1", "unknown field"),
            (
                "distortion = [0.0, 0.0, 0.0, 0.0, 0.0]",
                "distortion = [-9.15, -12.78, 0.0, 0.0, 285.2]",
                "camera.lens.distortion: an image that folds over",
            ),
        ] {
            let broken = text().replacen(from, to, 1);
            assert_ne!(broken, text(), "{from} not in {}", text());
            let message = Rig::from_toml(&broken, "c.toml").unwrap_err().to_string();
            assert!(message.contains(needle), "{message}");
        }
    }
}
