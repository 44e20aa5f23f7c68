//! Built-in dialects.

use phasmid_core::error::{Error, Result};
use phasmid_core::source::TomlSource;
use std::path::Path;

/// Name and text of each dialect.
pub(super) const DIALECTS: [(&str, &str); 3] = [
    ("scpi", phasmid_device_profiles::DIALECTS_SCPI),
    ("dlpc350", phasmid_device_profiles::DIALECTS_DLPC350),
    ("okline", phasmid_device_profiles::DIALECTS_OKLINE),
];

/// Loads a built-in dialect or a file.
pub(super) fn source(name_or_path: &str) -> Result<TomlSource> {
    if let Some((name, text)) = DIALECTS.iter().find(|(name, _)| *name == name_or_path) {
        return Ok(TomlSource::new(text, &format!("built-in dialect {name}")));
    }
    let path = Path::new(name_or_path);
    if !path.is_file() {
        let names: Vec<_> = DIALECTS.iter().map(|(name, _)| *name).collect();
        return Err(Error::input(
            format!("dialect {name_or_path:?}"),
            "neither a built-in name nor a file",
            format!("{} or the path of a TOML file", names.join(", ")),
        ));
    }
    TomlSource::read(path)
}
