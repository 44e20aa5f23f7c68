//! The reference phase's CT, and the skin in it.

use crate::error::{Error, Result};
use crate::geometry::{Mesh, extension};
use crate::patient::isosurface::{Parts, isosurface};
use crate::patient::volume::Volume;
use crate::patient::{dicom, metaimage};
use rayon::prelude::*;
use std::path::Path;

/// Part of a CT that may be body. No scanner's field of view is filled by a patient, but numbers that
/// are no Hounsfield units (air at 0) are all above any level of skin.
const MOST_BODY: f64 = 0.95;

/// A CT in the LPS of its scanner.
pub(super) struct Ct {
    pub(super) volume: Volume,
    /// File or folder, for messages.
    pub(super) place: String,
    /// What people call it.
    pub(super) title: String,
}

impl Ct {
    /// Reads a folder of DICOM, the one series or the phase of a 4D-CT, or a MetaImage.
    pub(super) fn read(path: &Path, percent: f64) -> Result<Self> {
        let place = path.display().to_string();
        let (volume, title) = if path.is_dir() {
            dicom::read_reference(path, percent)?
        } else if matches!(extension(path).as_str(), "mha" | "mhd") {
            (metaimage::read_volume(path)?, place.clone())
        } else {
            return Err(Error::input(
                place,
                "no folder and no MetaImage",
                "a folder with the images of a CT, .mha or .mhd",
            ));
        };
        Ok(Self {
            volume,
            place,
            title,
        })
    }

    /// The skin: the surface at a level in Hounsfield units around the largest body, without cavities.
    /// Where the CT ends it is capped; a couch whose voxels touch the body's is a part of it.
    pub(super) fn skin(&self, level_hu: f64) -> Result<Mesh> {
        let voxels = self.volume.voxels();
        let body = (0..voxels.len())
            .into_par_iter()
            .filter(|&n| f64::from(voxels.get(n)) >= level_hu)
            .count();
        let share = body as f64 / voxels.len() as f64;
        if share > MOST_BODY {
            return Err(Error::input(
                &self.place,
                format!("{:.0} % of the voxels at {level_hu} or more", 100.0 * share),
                "Hounsfield units, air near -1000, and a level between air and skin",
            ));
        }
        isosurface(
            &self.volume,
            level_hu,
            Parts::LargestFilled,
            &format!("{}: skin", self.place),
        )
    }
}
