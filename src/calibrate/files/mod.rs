//! Reads and writes calibrations in the formats of other programs. The format is recognised by the
//! file's content:
//!
//! | format | recognised by | written by |
//! | ------ | ------------- | ---------- |
//! | `calibration.toml` | anything else | Phasmid |
//! | OpenCV `FileStorage`, XML | begins with `<` | `cv::FileStorage`, SLStudio |
//! | OpenCV `FileStorage`, YAML | `%YAML`, `---`, or `name:` first | `cv::FileStorage`, others |
//! | OpenCV `FileStorage`, JSON | begins with `{` | `cv::FileStorage` |
//! | text with `Kc`, `kc`, `Kp`, `kp`, `Rp`, `Tp` | begins with `%%`, `#V`, or with one of the names, alone or before `=` | SLStudio (`.slcalib`, `.m`) |
//!
//! In every format except `calibration.toml`, the numbers have the meaning of OpenCV's
//! `stereoCalibrate`: camera matrices with pixel centres at integers, distortion k1 k2 p1 p2 k3,
//! and R, T that transform a point from the camera's frame to the projector's, `X_p = R X_c + T`.
//! SLStudio uses the same convention: its triangulation projects with `Kc [I | 0]` and `Kp [Rp |
//! Tp]`. Lengths are in millimetres.
//!
//! The parsers for YAML, XML and JSON support OpenCV's dialects only and are part of this module
//! instead of a library. They are small, because the values of a calibration are not nested. A
//! strict YAML parser rejects `%YAML:1.0`, which OpenCV up to version 4 writes, and a general XML
//! parser supports features that are dangerous in untrusted files: entities, namespaces, tags of
//! any size. All parsers take time and memory in proportion to the file, whose size is limited.
//!
//! | File | Contents |
//! | ---- | -------- |
//! | `xml`, `yaml`, `json`, `plain` | parsers, one per format |
//! | `node`, `number` | named matrices and numbers, common to all formats |
//! | `check` | assembles a rig from named matrices |
//! | `write` | writes YAML and XML |

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

pub use check::Sizes;
pub use write::{Format, Reprojection, to_opencv, write_opencv};

use phasmid_core::error::{Error, Result};
use phasmid_core::file;
use phasmid_geometry::Rig;
use std::path::Path;

/// Maximum file size; ample even for files that also contain the image points.
const MAX_BYTES: u64 = 8 << 20;

/// Reads a calibration in any supported format. The rig's frame is the camera's, except in
/// `calibration.toml`, which contains the frame.
///
/// # Errors
/// Returns an error, with the line if possible, if the file cannot be read, has no supported
/// format, lacks a matrix or an image size, or describes an invalid rig.
pub fn read_rig(path: &Path) -> Result<Rig> {
    read_rig_sized(path, Sizes::default())
}

/// Reads a calibration like [`read_rig`], with image sizes to use if the file contains none.
///
/// # Errors
/// Returns an error in the cases of [`read_rig`].
pub fn read_rig_sized(path: &Path, sizes: Sizes) -> Result<Rig> {
    let place = path.display().to_string();
    let bytes = file::read(path, MAX_BYTES)?;
    rig_from_bytes(&bytes, &place, sizes)
}

/// Reads a calibration from the bytes of a file; `place` names the file in messages.
///
/// # Errors
/// Returns an error in the cases of [`read_rig`].
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

/// Format of a text.
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
