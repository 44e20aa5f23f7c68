//! The output folder of a calibration, which receives all results or none.

use super::args::Args;
use crate::cli::interrupt::Unfinished;
use phasmid_calibrate::report;
use phasmid_core::error::{Error, Result};
use phasmid_decode::{CALIBRATION_FILE, Capture, MANIFEST_FILE};
use std::fs;
use std::path::{Path, PathBuf};

/// Folder for the captures of `--keep-captures`.
pub(super) const CAPTURES: &str = "captures";
/// Files of the rig in OpenCV's formats.
pub(super) const OPENCV: [&str; 2] = ["calibration.yml", "calibration.xml"];
/// File that compares the calibration with the true rig, which only an emulated device knows.
pub(super) const TRUTH: &str = "truth.json";

/// The output folder of a calibration in progress.
pub(super) struct Folder {
    folder: Unfinished,
    /// Names of files of an earlier calibration and, if captures are kept, of its captures.
    earlier: Vec<PathBuf>,
    /// Whether the folder contained captures before this calibration. They are replaced only if
    /// this calibration succeeds.
    had_captures: bool,
}

impl Folder {
    /// Creates the folder. Without `--force`, rejects existing files with names of results. New
    /// captures replace earlier captures of the same poses; `poses` are the names of the poses.
    ///
    /// # Errors
    /// Returns the errors of [`report::check_folder`]. If new captures are to be kept and the
    /// folder has earlier captures, also returns an error without `--force`, or if earlier captures
    /// are of other poses: old and new captures would later be mistaken for the captures of one
    /// calibration.
    pub(super) fn prepare(args: &Args, poses: &[String]) -> Result<Self> {
        let captures = args.out.join(CAPTURES);
        let had_captures = captures.symlink_metadata().is_ok();
        let [yaml, xml] = OPENCV;
        let mut earlier = report::check_folder(&args.out, &[TRUTH, yaml, xml], args.force)?;
        if args.keep_captures && had_captures {
            if !args.force {
                return Err(Error::input(
                    format!("--out {}", args.out.display()),
                    format!("{CAPTURES}, of an earlier calibration"),
                    "another folder, or --force to overwrite",
                ));
            }
            check_captures(&captures, poses)?;
            for pose in poses.iter().map(|name| Path::new(CAPTURES).join(name)) {
                let mut files = Capture::frames_in(&args.out.join(&pose))?;
                files.extend([MANIFEST_FILE, CALIBRATION_FILE].map(PathBuf::from));
                earlier.extend(files.iter().map(|file| pose.join(file)));
            }
        }
        Ok(Self {
            earlier,
            folder: Unfinished::create("--out", &args.out, args.force)?,
            had_captures,
        })
    }

    /// Protects the captures from which the calibration is computed, so that they are not replaced.
    pub(super) fn sparing(mut self, poses: &[PathBuf]) -> Self {
        let files = |pose: &PathBuf| {
            let frames = Capture::frames_in(pose).unwrap_or_default();
            let others = [MANIFEST_FILE, CALIBRATION_FILE].map(PathBuf::from);
            let pose = pose.clone();
            frames
                .into_iter()
                .chain(others)
                .map(move |file| pose.join(file))
        };
        self.folder = self.folder.sparing(poses.iter().flat_map(files));
        self
    }

    /// Returns the folder for the output of the run in progress.
    pub(super) fn draft(&self) -> &Path {
        self.folder.draft()
    }

    /// Moves the captures to the output folder, so that they remain if the calibration fails; does
    /// nothing if the folder has earlier captures.
    ///
    /// # Errors
    /// Returns an error if a file or folder cannot be moved.
    pub(super) fn keep_captures(&self) -> Result<()> {
        match self.had_captures {
            true => Ok(()),
            false => self.folder.keep(CAPTURES),
        }
    }

    /// Moves all remaining files of the draft to the output folder.
    ///
    /// # Errors
    /// Returns an error if a file cannot be moved.
    pub(super) fn finish(self) -> Result<()> {
        self.folder.finish(self.earlier, Some(report::MARKER))
    }
}

/// Rejects captures of poses other than `poses`, and anything else with the name of a pose. Links
/// are not followed, because no calibration creates links.
fn check_captures(captures: &Path, poses: &[String]) -> Result<()> {
    let is_dir = |path: &Path| path.symlink_metadata().is_ok_and(|about| about.is_dir());
    let refuse = |path: &Path, found| Err(Error::input(path.display(), found, "another --out"));
    if !is_dir(captures) {
        return refuse(
            captures,
            "not a folder, but has the name of a captures folder",
        );
    }
    for entry in fs::read_dir(captures).map_err(|e| Error::io(captures, e))? {
        let path = entry.map_err(|e| Error::io(captures, e))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if !name.starts_with("pose_") {
            continue;
        }
        if !is_dir(&path) || !path.join(MANIFEST_FILE).exists() {
            return refuse(&path, "not a capture, but has the name of a capture");
        }
        if !poses.iter().any(|pose| *pose == *name) {
            return refuse(&path, "a capture that this calibration would not replace");
        }
    }
    Ok(())
}
