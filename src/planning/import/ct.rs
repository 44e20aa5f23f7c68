//! The reference phase's CT, and the skin in it.

use crate::isosurface::{Parts, isosurface};
use crate::volume::Volume;
use crate::{dicom, metaimage};
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{Mesh, extension};
use rayon::prelude::*;
use std::path::Path;

/// Part of a CT that may be body. No scanner's field of view is filled by a patient, but numbers that
/// are no Hounsfield units (air at 0) are all above any level of skin.
const MOST_BODY: f64 = 0.95;

/// Denser than bone and all that is not metal, in Hounsfield units; and the part of a CT that may be.
/// Of numbers whose bytes are swapped, or that are of another kind of image, far more are.
const DENSE_HU: f32 = 4095.0;
const MOST_DENSE: f64 = 0.01;

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
        let share_of = |is: &(dyn Fn(f32) -> bool + Sync)| {
            let all = (0..voxels.len()).into_par_iter();
            all.filter(|&n| is(voxels.get(n))).count() as f64 / voxels.len() as f64
        };
        let dense = share_of(&|hu| hu > DENSE_HU);
        if dense > MOST_DENSE {
            return Err(Error::input(
                &self.place,
                format!("{:.0} % of the voxels above {DENSE_HU}", 100.0 * dense),
                format!(
                    "Hounsfield units, at most {:.0} % of them above {DENSE_HU}: metal (are the bytes in \
                     the order that the header says?)",
                    100.0 * MOST_DENSE
                ),
            ));
        }
        let share = share_of(&|hu| f64::from(hu) >= level_hu);
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
