//! Writes the station file with new poses.

use phasmid_core::error::{Error, Result};
use phasmid_core::new_file;
use phasmid_geometry::Pose;
use phasmid_profile::{Station, profile_names, scene_names};
use phasmid_protocol::dialect::Dialect;
use std::io::Write;
use std::path::Path;

/// Sets a device's pose to the measured one.
pub(super) fn move_to(station: &mut Station, name: &str, room_from_rig: &Pose) {
    let (position_mm, rotation_deg) = room_from_rig.to_xyz_deg();
    for device in station.device.iter_mut().filter(|d| d.name == name) {
        device.position_mm = Some(position_mm);
        device.rotation_deg = Some(rotation_deg);
    }
}

/// Writes a new station file. Its paths are absolute, so that it works from any folder.
///
/// # Errors
/// Returns an error if the file exists and `force` is not set, or if it cannot be written.
pub(super) fn write(station: &Station, path: &Path, force: bool) -> Result<()> {
    let mut whole = station.clone();
    whole.scene = match station.scene() {
        Some(scene) => Some(anywhere(scene, scene_names())?),
        None => None,
    };
    for (device, of) in whole.device.iter_mut().zip(&station.device) {
        device.profile = anywhere(station.profile(of), profile_names())?;
        device.dialect = match station.dialect(of) {
            Some(dialect) => Some(anywhere(dialect, Dialect::names())?),
            None => None,
        };
    }
    let text = toml::to_string(&whole).expect("numbers and words");
    new_file::write(path, force, |out| {
        write!(
            out,
            "# Places as `phasmid locate` has measured them.\n\n{text}"
        )
    })
}

/// Returns a built-in name unchanged, and a file as an absolute path.
fn anywhere(name: String, mut built_in: impl Iterator<Item = &'static str>) -> Result<String> {
    if built_in.any(|known| known == name) {
        return Ok(name);
    }
    let path = std::path::absolute(&name).map_err(|e| Error::io(&name, e))?;
    Ok(path.display().to_string())
}
