//! The report's folder.

use phasmid_core::error::{Error, Result};
use phasmid_core::new_file;
use std::fs;
use std::path::{Path, PathBuf};

/// Files that [`write()`](super::write()) creates.
pub const FILES: [&str; 7] = [
    "report.html",
    "points.csv",
    "poses.csv",
    "parameters.csv",
    "covariance.csv",
    "calibration.toml",
    "summary.json",
];

/// Creates the report's folder. Files that would be overwritten are any of [`FILES`] and `also`,
/// and the images `found_*.png`. With `force` these are deleted, so that no file of an earlier
/// calibration remains.
///
/// # Errors
/// Returns an error if the path is a file, if the folder contains such files and `force` is not
/// set, or if the file system fails.
pub fn prepare(folder: &Path, also: &[&str], force: bool) -> Result<()> {
    let place = || format!("--out {}", folder.display());
    new_file::check_folder(folder, [""; 0], force)?;
    fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    let ours = ours(folder, also)?;
    if force {
        return ours
            .iter()
            .try_for_each(|path| fs::remove_file(path).map_err(|e| Error::io(path, e)));
    }
    let Some(first) = ours.first() else {
        return Ok(());
    };
    let whose = if is_calibration(folder) {
        "of an earlier calibration"
    } else {
        "not written by a calibration"
    };
    let name = first.file_name().unwrap_or_default().to_string_lossy();
    Err(Error::input(
        place(),
        format!("{name}, {whose}"),
        "another folder, or --force to overwrite",
    ))
}

/// Returns whether a folder contains a calibration written by this program.
pub fn is_calibration(folder: &Path) -> bool {
    let summary = fs::read_to_string(folder.join("summary.json")).unwrap_or_default();
    summary.contains("\"made_by\": \"phasmid calibrate")
}

/// Existing files that would be overwritten, sorted.
fn ours(folder: &Path, also: &[&str]) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(|e| Error::io(folder, e))? {
        let path = entry.map_err(|e| Error::io(folder, e))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let image = name.starts_with("found_") && name.ends_with(".png");
        if image || FILES.contains(&&*name) || also.contains(&&*name) {
            found.push(path);
        }
    }
    found.sort_unstable();
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn existing_files_are_kept_unless_forced() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("a/b");
        prepare(&out, &["truth.json"], false).unwrap();
        prepare(&out, &["truth.json"], false).unwrap();
        fs::write(out.join("notes.txt"), "mine").unwrap();
        prepare(&out, &[], false).unwrap();
        for name in FILES.into_iter().chain(["found_x.png", "truth.json"]) {
            fs::write(out.join(name), "old").unwrap();
            let told = prepare(&out, &["truth.json"], false)
                .unwrap_err()
                .to_string();
            assert!(told.contains(name) && told.contains("--force"), "{told}");
            assert!(told.contains("not written by a calibration"), "{told}");
            prepare(&out, &["truth.json"], true).unwrap();
            assert!(!out.join(name).exists());
        }
        assert!(out.join("notes.txt").exists());
        let mine = "{\n  \"made_by\": \"phasmid calibrate 9\"\n}";
        fs::write(out.join("summary.json"), mine).unwrap();
        let told = prepare(&out, &[], false).unwrap_err().to_string();
        assert!(told.contains("an earlier calibration"), "{told}");
        let file = out.join("notes.txt");
        let told = prepare(&file, &[], true).unwrap_err().to_string();
        assert!(told.contains("a file"), "{told}");
    }
}
