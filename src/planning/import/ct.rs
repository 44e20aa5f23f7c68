//! The CT of the reference phase and its skin.

use crate::isosurface::{Parts, isosurface};
use crate::volume::Volume;
use crate::{dicom, metaimage};
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{Mesh, extension};
use rayon::prelude::*;
use std::path::Path;

/// Maximum fraction of a CT above the skin level. No patient fills a scanner's field of view, but
/// if the values are not Hounsfield units (air at 0), all are above any skin level.
const MOST_BODY: f64 = 0.95;

/// Value in Hounsfield units above bone, reached only by metal. If the byte order is swapped or the
/// image is not a CT, many more voxels exceed it.
const DENSE_HU: f32 = 4095.0;
/// Maximum fraction of a CT above `DENSE_HU`.
const MOST_DENSE: f64 = 0.01;

/// A CT in its scanner's LPS.
pub(super) struct Ct {
    pub(super) volume: Volume,
    /// File or folder, for messages.
    pub(super) place: String,
    /// Title, for display.
    pub(super) title: String,
}

impl Ct {
    /// Reads a MetaImage, or a DICOM folder with a single series or a 4D-CT that includes the
    /// phase.
    pub(super) fn read(path: &Path, percent: f64) -> Result<Self> {
        let place = path.display().to_string();
        let (volume, title) = if path.is_dir() {
            dicom::read_reference(path, percent)?
        } else if matches!(extension(path).as_str(), "mha" | "mhd") {
            (metaimage::read_volume(path)?, place.clone())
        } else {
            return Err(Error::input(
                place,
                "neither a folder nor a MetaImage",
                "a folder with the images of a CT, .mha or .mhd",
            ));
        };
        Ok(Self {
            volume,
            place,
            title,
        })
    }

    /// Extracts the skin: the iso-surface at a level in Hounsfield units around the largest body,
    /// without cavities. It is capped where the CT ends; a couch whose voxels touch the body is
    /// included.
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
                format!(
                    "{:.0} % of the voxels are above {DENSE_HU} HU: the scale or byte order may be \
                     wrong",
                    100.0 * dense
                ),
                format!(
                    "Hounsfield units, at most {:.0} % of them above {DENSE_HU} (metal)",
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
