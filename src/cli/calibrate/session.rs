//! Collects the poses of one calibration and saves an annotated image of each.

use phasmid_calibrate::report::image_names;
use phasmid_calibrate::rig::{Gathering, Looked, Poses};
use phasmid_core::error::Result;
use phasmid_core::new_file;
use std::path::{Path, PathBuf};

/// The poses received so far.
pub(super) struct Session {
    folder: PathBuf,
    /// For each expected pose: its name, and the name of its image file.
    names: Vec<(String, String)>,
    images: Vec<(String, String)>,
    poses: Gathering,
}

/// All poses of a calibration.
pub(super) struct Gathered {
    pub(super) poses: Poses,
    /// For each pose with an image: its name, and the name of its image file.
    pub(super) images: Vec<(String, String)>,
}

impl Session {
    /// Starts without poses. `names` are the names of all expected poses in order; images go to
    /// `folder`.
    pub(super) fn new(folder: &Path, names: &[String]) -> Self {
        let files = image_names(names);
        Self {
            folder: folder.to_owned(),
            names: names.iter().cloned().zip(files).collect(),
            images: Vec::new(),
            poses: Gathering::new(names.to_vec()),
        }
    }

    /// Adds a pose by its index among the names. A pose that is invalid or shows no board is noted,
    /// and the calibration continues with the other poses.
    ///
    /// # Errors
    /// Returns an error if the image cannot be written.
    pub(super) fn take(&mut self, place: usize, looked: Result<Looked>) -> Result<()> {
        if let (Some((name, file)), Ok(looked)) = (self.names.get(place), &looked) {
            let path = self.folder.join(file);
            new_file::write_image(&path, false, |out| {
                looked.picture.write_to(out, image::ImageFormat::Png)
            })?;
            self.images.push((name.clone(), file.clone()));
        }
        self.poses.take(place, looked);
        Ok(())
    }

    /// Excludes poses whose image size differs from the majority's, and returns the remaining poses.
    pub(super) fn finish(self) -> Gathered {
        Gathered {
            poses: self.poses.finish(),
            images: self.images,
        }
    }
}
