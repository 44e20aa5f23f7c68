//! The sequence manifest: the projected patterns, frame by frame, in a schema shared by the device
//! profiles, the decoder and captures from other systems.

use super::Pattern;
use phasmid_core::error::Result;
use phasmid_core::source::TomlSource;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Maximum number of frames; a larger manifest is a mistake or an attack.
pub const MAX_FRAMES: usize = 4096;
/// Maximum image side in pixels, for projectors, cameras and images.
pub const MAX_SIDE_PX: u32 = 32768;

/// The projector's size in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ProjectorSize {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
}

/// One frame: the projected pattern and, if frames are files, the photograph of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ManifestFrame {
    /// Photograph, relative to the folder of the frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// The projected pattern.
    pub pattern: Pattern,
}

/// A sequence of patterns and the size of the projector that shows it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// The projector that shows the sequence.
    pub projector: ProjectorSize,
    /// The frames in temporal order.
    #[serde(deserialize_with = "crate::written::frames")]
    #[cfg_attr(feature = "schema", schemars(with = "Vec<crate::written::Entry>"))]
    pub frame: Vec<ManifestFrame>,
}

impl Manifest {
    /// Reads and checks a manifest file.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read or [`Self::parse`] rejects its content.
    pub fn read(path: &Path) -> Result<Self> {
        let source = TomlSource::read(path)?;
        Self::from_source(&source)
    }

    /// Parses and checks a manifest; `place` is used as the file name in messages.
    ///
    /// # Errors
    /// Returns an error with the line for an unknown field, a wrong type or a value out of range.
    pub fn parse(text: &str, place: &str) -> Result<Self> {
        Self::from_source(&TomlSource::new(text, place))
    }

    fn from_source(source: &TomlSource) -> Result<Self> {
        let manifest: Self = source.deserialize()?;
        let ProjectorSize {
            width_px,
            height_px,
        } = manifest.projector;
        for (field, side) in [("width_px", width_px), ("height_px", height_px)] {
            if !(1..=MAX_SIDE_PX).contains(&side) {
                return Err(source.violation(
                    &format!("projector.{field}"),
                    side,
                    format!("1 to {MAX_SIDE_PX}"),
                ));
            }
        }
        check_count(&manifest.frame, "frame", source)?;
        Ok(manifest)
    }

    /// Returns the manifest as TOML.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("numbers, strings and tables always serialise")
    }
}

/// Checks the number of frames of a list; `field` is the path of the list in `source`.
///
/// # Errors
/// Returns an error with the line of the list if it has no frame or too many.
pub fn check_count(frames: &[ManifestFrame], field: &str, source: &TomlSource) -> Result<()> {
    if (1..=MAX_FRAMES).contains(&frames.len()) {
        return Ok(());
    }
    Err(source.violation(
        field,
        format!("{} frames", frames.len()),
        format!("1 to {MAX_FRAMES} frames"),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Axis;

    const HEAD: &str = "[projector]\nwidth_px = 1920\nheight_px = 1080\n";

    #[test]
    fn every_pattern_kind_is_read_and_written_back() {
        let text = format!(
            "{HEAD}
[[frame]]
file = \"pat00.png\"      # only where frames are files
pattern = {{ kind = \"fringe\", axis = \"x\", period_px = 100, phase_rad = 0 }}
[[frame]]
pattern = {{ kind = \"gray\", axis = \"y\", cell_px = 100, bits = 5, bit = 4, inverted = false }}
[[frame]]
pattern = {{ kind = \"white\" }}
[[frame]]
pattern = {{ kind = \"image\", file = \"speckle.png\" }}
"
        );
        let manifest = Manifest::parse(&text, "test").unwrap();
        assert_eq!(manifest.frame.len(), 4);
        assert_eq!(manifest.frame[1].pattern.axis(), Some(Axis::Y));
        assert_eq!(
            Manifest::parse(&manifest.to_toml(), "again").unwrap(),
            manifest
        );
    }

    #[test]
    fn errors_name_line_value_and_range() {
        for (frame, needles) in [
            (
                "pattern = { kind = \"fringe\", axis = \"x\", period_px = -4, phase_rad = 0 }",
                ["m.toml:5", "-4", "above 2"],
            ),
            (
                "pattern = { kind = \"gray\", axis = \"x\", cell_px = 8, bits = 3, bit = 3 }",
                ["m.toml:5", "3", "0 to bits - 1 = 2"],
            ),
            (
                "pattern = { kind = \"white\", colour = 3 }",
                ["m.toml:5", "colour", "unknown field"],
            ),
            (
                "pattern = { kind = \"stripes\" }",
                ["m.toml:5", "stripes", "fringe"],
            ),
            (
                "pattern = { kind = \"fringe\", axis = \"x\", period_px = nan, phase_rad = 0 }",
                ["m.toml:5", "NaN", "above 2"],
            ),
        ] {
            let text = format!("{HEAD}[[frame]]\n{frame}\n");
            let message = Manifest::parse(&text, "m.toml").unwrap_err().to_string();
            for needle in needles {
                assert!(message.contains(needle), "{needle} not in: {message}");
            }
        }
        assert!(Manifest::parse(HEAD, "m.toml").is_err());
    }
}
