//! The report's folder.

use phasmid_core::error::{Error, Result};
use phasmid_core::{file, new_file};
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
    MARKER,
];

/// The file whose presence marks a folder as a calibration.
pub const MARKER: &str = "summary.json";

/// Returns the names of the files in a folder that a calibration would replace: any of [`FILES`] and
/// `also`, and with `force` the images `found_*.png` that its `report.html` shows. The folder need not
/// exist.
///
/// # Errors
/// Returns an error if the path is a file, if the folder contains such files and `force` is not
/// set, or if the file system fails.
pub fn check_folder(folder: &Path, also: &[&str], force: bool) -> Result<Vec<PathBuf>> {
    let place = || format!("--out {}", folder.display());
    new_file::check_folder(folder, [""; 0], force)?;
    let mut earlier = earlier(folder, also)?;
    if force {
        let page = file::read(&folder.join(FILES[0]), 1 << 26).unwrap_or_default();
        let page = String::from_utf8_lossy(&page);
        earlier.retain(|name| {
            let name = name.to_string_lossy();
            !name.starts_with("found_") || page.contains(&*name)
        });
    }
    let Some(first) = earlier.first().filter(|_| !force) else {
        new_file::check_folder(folder, &earlier, force)?;
        return Ok(earlier);
    };
    let whose = if is_calibration(folder) {
        "of an earlier calibration"
    } else {
        "not written by a calibration"
    };
    Err(Error::input(
        place(),
        format!("{}, {whose}", first.display()),
        "another folder, or --force to overwrite",
    ))
}

/// Returns whether a folder contains a calibration written by this program.
pub fn is_calibration(folder: &Path) -> bool {
    let summary = file::read(&folder.join(MARKER), 1 << 24).unwrap_or_default();
    String::from_utf8_lossy(&summary).contains("\"made_by\": \"phasmid calibrate")
}

/// Names of existing files that would be overwritten, sorted.
fn earlier(folder: &Path, also: &[&str]) -> Result<Vec<PathBuf>> {
    let entries = match fs::read_dir(folder) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(|e| Error::io(folder, e))?,
    };
    let mut found = Vec::new();
    for entry in entries {
        let name = entry.map_err(|e| Error::io(folder, e))?.file_name();
        let text = name.to_string_lossy();
        let image = text.starts_with("found_") && text.ends_with(".png");
        if image || FILES.contains(&&*text) || also.contains(&&*text) {
            found.push(PathBuf::from(name));
        }
    }
    found.sort_unstable();
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn existing_files_are_listed_and_refused_without_force() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("a");
        assert!(
            check_folder(&out, &["truth.json"], false)
                .unwrap()
                .is_empty()
        );
        fs::create_dir(&out).unwrap();
        fs::write(out.join("notes.txt"), "mine").unwrap();
        assert!(
            check_folder(&out, &["truth.json"], false)
                .unwrap()
                .is_empty()
        );
        for name in FILES.into_iter().chain(["found_x.png", "truth.json"]) {
            fs::write(out.join(name), "old").unwrap();
            if name.starts_with("found_") {
                fs::write(out.join(FILES[0]), "<img src=\"found_x.png\">").unwrap();
                fs::write(out.join("found_mine.png"), "mine").unwrap();
            }
            let told = check_folder(&out, &["truth.json"], false)
                .unwrap_err()
                .to_string();
            assert!(told.contains("--force"), "{told}");
            assert!(told.contains("not written by a calibration"), "{told}");
            let earlier = check_folder(&out, &["truth.json"], true).unwrap();
            assert!(earlier.iter().any(|file| file == Path::new(name)));
            assert!(
                !earlier
                    .iter()
                    .any(|file| file == Path::new("found_mine.png"))
            );
            fs::remove_file(out.join(name)).unwrap();
        }
        fs::remove_file(out.join("found_mine.png")).unwrap();
        let mine = "{\n  \"made_by\": \"phasmid calibrate 9\"\n}";
        fs::write(out.join("summary.json"), mine).unwrap();
        let told = check_folder(&out, &[], false).unwrap_err().to_string();
        assert!(told.contains("an earlier calibration"), "{told}");
        let file = out.join("notes.txt");
        let told = check_folder(&file, &[], true).unwrap_err().to_string();
        assert!(told.contains("a file"), "{told}");
    }
}
