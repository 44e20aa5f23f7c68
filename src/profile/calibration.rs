//! Calibration defaults of a scanner model, which `phasmid calibrate` uses unless options override
//! them; and the model's factory calibration.

use super::Sequence;
use phasmid_core::check::Check;
use phasmid_core::error::Result;
use phasmid_core::wording::did_you_mean;
use phasmid_pattern::Axis;
use serde::{Deserialize, Serialize};

/// Calibration defaults of a device.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Calibration {
    /// Name of a sequence that encodes both projector axes; when absent, the first such sequence.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sequence: Option<String>,
    /// Scale factor of the default dot board, so that the camera resolves the dots; 1 when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub board_scale: Option<f64>,
    /// Distance from the camera at which boards are placed, in millimetres; when absent, where the
    /// centres of the camera's and the projector's fields of view meet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance_mm: Option<f64>,
}

impl Calibration {
    /// Returns the calibration sequence among a device's sequences: the one with the name
    /// `self.sequence`, or else the first with patterns along both axes.
    pub(super) fn sequence_among<'a>(&self, sequences: &'a [Sequence]) -> Option<&'a Sequence> {
        let wanted = self.sequence.as_ref();
        sequences.iter().find(|sequence| match wanted {
            Some(name) => sequence.name == *name,
            None => has_both_axes(sequence),
        })
    }
}

fn has_both_axes(sequence: &Sequence) -> bool {
    let has = |axis| {
        let mut patterns = sequence.frame.iter().map(|frame| &frame.pattern);
        patterns.any(|pattern| pattern.axis() == Some(axis))
    };
    has(Axis::X) && has(Axis::Y)
}

/// Checks the calibration defaults of a device with these sequences.
pub(super) fn check(c: &Calibration, sequences: &[Sequence], check: &Check<'_>) -> Result<()> {
    if let Some(name) = &c.sequence {
        let found = sequences.iter().find(|sequence| sequence.name == *name);
        let names: Vec<_> = sequences.iter().map(|s| s.name.as_str()).collect();
        check.that(
            found.is_some(),
            "calibration.sequence",
            format!(
                "{name:?}, not a sequence of this profile{}",
                did_you_mean(name, names.iter().copied())
            ),
            names.join(", "),
        )?;
        check.that(
            found.is_none_or(has_both_axes),
            "calibration.sequence",
            format!("{name:?}, which has patterns along one axis at most"),
            "a sequence with patterns along x and along y",
        )?;
    }
    if let Some(scale) = c.board_scale {
        check.within("calibration.board_scale", scale, 1e-3..=1e3)?;
    }
    if let Some(distance) = c.distance_mm {
        check.within("calibration.distance_mm", distance, 1.0..=1e6)?;
    }
    Ok(())
}

/// Factory calibration of a device: the answer to `CALibration:DATA?`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct FactoryCalibration {
    /// Report the exact rig instead of a measured one, without a covariance.
    pub exact: bool,
    /// Sigma of a board point's camera pixel along either axis, in pixels. Its projector coordinate,
    /// as read at that pixel, has the same sigma in the projector's pixels. The board is that of
    /// `[calibration]`, or a smaller one if it does not fit into the field. The serial number
    /// determines the errors.
    pub corner_px: f64,
}

impl Default for FactoryCalibration {
    fn default() -> Self {
        Self {
            exact: false,
            corner_px: 0.05,
        }
    }
}

pub(super) fn check_factory(factory: &FactoryCalibration, check: &Check<'_>) -> Result<()> {
    let corner_px = factory.corner_px;
    check.within("factory_calibration.corner_px", corner_px, 1e-4..=1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Profile, profile_names};

    #[test]
    fn every_profile_names_a_calibration_sequence() {
        for name in profile_names() {
            let profile = Profile::load(name).unwrap();
            let sequence = profile.calibration_sequence().unwrap();
            assert!(has_both_axes(sequence), "{name}");
            let named = Some(sequence.name.clone());
            assert_eq!(profile.calibration.sequence, named, "{name}");
            assert!(!has_both_axes(&profile.sequence[0]), "{name}");
        }
    }

    #[test]
    fn default_sequence_is_the_first_with_both_axes() {
        let text = phasmid_device_profiles::WEBCAM_GREY;
        let mut table: toml::Table = text.parse().unwrap();
        table.remove("calibration");
        let profile = Profile::parse(&table.to_string(), "test").unwrap();
        assert_eq!(profile.calibration, Calibration::default());
        assert_eq!(profile.calibration_sequence().unwrap().name, "quick-4-xy");
    }

    #[test]
    fn errors_name_field_and_allowed_values() {
        let text = phasmid_device_profiles::WEBCAM_GREY;
        for (line, needles) in [
            (
                "sequence = \"moon\"",
                ["calibration.sequence", "quick-4, quick-4-xy"],
            ),
            (
                "sequence = \"quikc-4-xy\"",
                ["calibration.sequence", "(did you mean `quick-4-xy`?)"],
            ),
            ("sequence = \"quick-4\"", ["one axis at most", "along y"]),
            (
                "board_scale = 0.0",
                ["calibration.board_scale", "0.001 to 1000"],
            ),
            (
                "distance_mm = nan",
                ["calibration.distance_mm", "1 to 1000000"],
            ),
            ("moon = 1", ["moon", "unknown field"]),
        ] {
            let mut table: toml::Table = text.parse().unwrap();
            table.insert(
                "calibration".into(),
                toml::Value::Table(line.parse().unwrap()),
            );
            let words = Profile::parse(&table.to_string(), "test").unwrap_err();
            let words = words.to_string();
            assert!(needles.iter().all(|n| words.contains(n)), "{words}");
        }
    }
}
