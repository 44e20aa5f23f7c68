//! Reads poses from folders of captures, which may come from any device.

use super::session::{Gathered, Session};
use crate::cli::interrupt::check;
use phasmid_calibrate::rig::{Looked, look};
use phasmid_core::error::{Error, Result};
use phasmid_decode::{CALIBRATION_FILE, Known, MANIFEST_FILE, Plan, check_sequence, load_frames};
use phasmid_geometry::board_poses::MOST_POSES;
use phasmid_geometry::{Board, Rig};
use phasmid_pattern::Manifest;
use std::fs;
use std::path::{Path, PathBuf};

/// Decodes the poses one after the other and saves an annotated image of each.
///
/// # Errors
/// Returns an error if an image cannot be written, or if the user has interrupted the calibration.
pub(super) fn look_at_all(
    poses: &[PathBuf],
    board: &Board,
    images: &Path,
    mut progress: impl FnMut(usize, usize),
) -> Result<Gathered> {
    let names: Vec<String> = poses.iter().map(|pose| name(pose)).collect();
    let mut session = Session::new(images, &names);
    for (place, (pose, name)) in poses.iter().zip(&names).enumerate() {
        check()?;
        progress(place, poses.len());
        session.take(place, one(pose, name, board))?;
    }
    Ok(session.finish())
}

fn name(folder: &Path) -> String {
    let name = folder.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// Returns the folders of the poses in a folder, sorted by name.
///
/// # Errors
/// Returns an error if the folder contains no subfolder, or more than `MOST_POSES` subfolders.
pub(super) fn poses(folder: &Path) -> Result<Vec<PathBuf>> {
    let place = || format!("--captures {}", folder.display());
    let allowed =
        format!("a folder with a subfolder for each pose, each with images and {MANIFEST_FILE}");
    if folder.join(MANIFEST_FILE).exists() {
        let found = format!("{MANIFEST_FILE}, of a single pose");
        return Err(Error::input(place(), found, allowed));
    }
    if folder.is_file() {
        return Err(Error::input(place(), "a file", allowed));
    }
    let mut poses = Vec::new();
    for entry in fs::read_dir(folder).map_err(|e| Error::io(folder, e).at("--captures"))? {
        let path = entry.map_err(|e| Error::io(folder, e))?.path();
        if path.is_dir() {
            poses.push(path);
        }
        if poses.len() > MOST_POSES {
            let found = format!("more than {MOST_POSES} folders");
            return Err(Error::input(place(), found, format!("{MOST_POSES} poses")));
        }
    }
    if poses.is_empty() {
        return Err(Error::input(place(), "no subfolder", allowed));
    }
    poses.sort_unstable();
    Ok(poses)
}

fn one(folder: &Path, name: &str, board: &Board) -> Result<Looked> {
    let file = folder.join(MANIFEST_FILE);
    let manifest = Manifest::read(&file)?;
    let calibration = folder.join(CALIBRATION_FILE);
    let nominal = match calibration.exists() {
        true => Some(Rig::read(&calibration)?),
        false => None,
    };
    let plan = Plan::new(&manifest).map_err(|e| e.at(file.display()))?;
    let images = load_frames(&manifest, &plan, folder)?;
    let known = Known::new(false, nominal.as_ref());
    let looked =
        look(board, name, &manifest, &images, nominal).map_err(|e| e.at(folder.display()))?;
    check_sequence(&manifest, &images, known).map_err(|why| {
        Error::input(
            folder.display(),
            why,
            "a capture of the manifest's sequence",
        )
    })?;
    Ok(looked)
}
