//! Calibrations in the formats that others write and read, told apart by what is in the file:
//!
//! | format | how it is known | written by |
//! | ------ | --------------- | ---------- |
//! | `calibration.toml` | none of the others | Phasmid |
//! | OpenCV `FileStorage`, XML | begins with `<` | `cv::FileStorage`, SLStudio |
//! | OpenCV `FileStorage`, YAML | `%YAML`, `---`, or `name:` first | `cv::FileStorage`, others |
//! | OpenCV `FileStorage`, JSON | begins with `{` | `cv::FileStorage` |
//! | text with `Kc`, `kc`, `Kp`, `kp`, `Rp`, `Tp` | begins with `%%`, `#V`, or with one of the names, alone or before `=` | SLStudio (`.slcalib`, `.m`) |
//!
//! Whatever the names in a foreign file, its numbers mean what OpenCV's `stereoCalibrate` says: camera
//! matrices with pixel centres at integers, distortion k1 k2 p1 p2 k3, and R, T that take a point of
//! the camera's frame to the projector's, `X_p = R X_c + T`. SLStudio does so too: its triangulation
//! projects with `Kc [I | 0]` and `Kp [Rp | Tp]`. Lengths are taken as millimetres.
//!
//! The readers of YAML, XML and JSON are of OpenCV's dialects alone, and ours: they are small (nothing in
//! a calibration nests), `%YAML:1.0`, as OpenCV up to 4 begins, is not YAML to a strict reader, and
//! general XML brings what a file from anywhere must not: entities, namespaces, tags of any size.
//! All take time and memory in proportion to the file, whose size is bounded.

mod check;
mod json;
mod node;
mod number;
mod plain;
mod write;
mod xml;
mod yaml;

#[cfg(test)]
mod tests;

pub use write::{Format, Reprojection, to_opencv, write_opencv};

use phasmid_core::error::{Error, Result};
use phasmid_core::file;
use phasmid_geometry::Rig;
use std::path::Path;

/// Larger than any calibration, also one that holds the points of its pictures.
const MAX_BYTES: u64 = 8 << 20;

/// Image sizes, columns and rows, for files that do not hold them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Of the camera.
    pub camera: Option<[u32; 2]>,
    /// Of the projector.
    pub projector: Option<[u32; 2]>,
}

/// Reads a calibration in any format that this module knows. The rig's frame is the camera's, except
/// in our own format, which says.
///
/// # Errors
/// A file that cannot be read, that is none of the formats, lacks a matrix or an image size, or
/// whose numbers no rig can have; with the line.
pub fn read_rig(path: &Path) -> Result<Rig> {
    read_rig_sized(path, Sizes::default())
}

/// [`read_rig`] with image sizes to take where the file holds none.
///
/// # Errors
/// As [`read_rig`].
pub fn read_rig_sized(path: &Path, sizes: Sizes) -> Result<Rig> {
    let place = path.display().to_string();
    let bytes = file::read(path, MAX_BYTES)?;
    rig_from_bytes(&bytes, &place, sizes)
}

/// Reads a calibration from a file's bytes; `place` names the file in messages.
///
/// # Errors
/// As [`read_rig`].
pub fn rig_from_bytes(bytes: &[u8], place: &str, sizes: Sizes) -> Result<Rig> {
    let text = std::str::from_utf8(bytes).map_err(|e| {
        Error::input(
            place,
            e,
            "a calibration in TOML, or in OpenCV's YAML, XML or JSON, in UTF-8",
        )
    })?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let nodes = match Kind::of(text) {
        Kind::Toml => return Rig::from_toml(text, place),
        Kind::Xml => xml::parse(text),
        Kind::Yaml => yaml::parse(text),
        Kind::Json => json::parse(text),
        Kind::Plain => plain::parse(text),
    };
    let rig = nodes.and_then(|nodes| check::rig(&nodes, sizes));
    let rig = rig.map_err(|fault| {
        let place = match fault.line {
            0 => place.to_owned(),
            line => format!("{place}:{line}"),
        };
        Error::input(place, fault.found, fault.allowed)
    })?;
    rig.check()
        .map_err(|v| Error::input(format!("{place}: {}", v.field), v.found, v.allowed))?;
    Ok(rig)
}

/// What a text is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Toml,
    Xml,
    Yaml,
    Json,
    Plain,
}

impl Kind {
    fn of(text: &str) -> Self {
        let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
        let Some(first) = lines.next() else {
            return Self::Toml;
        };
        if first.starts_with('<') {
            return Self::Xml;
        }
        if first.starts_with('{') {
            return Self::Json;
        }
        if first.starts_with("%YAML") || first == "---" {
            return Self::Yaml;
        }
        if first.starts_with('%') || first.starts_with("#V") {
            return Self::Plain;
        }
        let mut first = std::iter::once(first).chain(lines);
        let line = first.find(|line| !line.starts_with('#')).unwrap_or("");
        let rest = line.trim_start_matches(|c: char| c.is_alphanumeric() || "_.-".contains(c));
        let name = &line[..line.len() - rest.len()];
        match rest.trim_start().chars().next() {
            Some(':') if !name.is_empty() => Self::Yaml,
            None | Some('=') if node::names::ALL.iter().any(|names| names.contains(&name)) => {
                Self::Plain
            }
            _ => Self::Toml,
        }
    }
}
