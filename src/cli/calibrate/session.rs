//! The poses of one calibration as they come: what was found in each, and a picture of it.

use super::look::Looked;
use crate::calibrate::report::picture_names;
use crate::calibrate::rig::{Missed, PoseData};
use crate::error::{Error, Result};
use crate::geometry::{NoiseModel, Rig};
use std::path::{Path, PathBuf};

/// What is known of the poses so far.
pub(super) struct Session {
    out: PathBuf,
    /// Name of each pose that is to come, and of the picture that there will be of it.
    names: Vec<(String, String)>,
    /// Names of the poses that there are pictures of, and of these.
    pub(super) pictures: Vec<(String, String)>,
    /// Places of the poses with a board among all.
    pub(super) places: Vec<usize>,
    pub(super) poses: Vec<PoseData>,
    pub(super) missed: Vec<Missed>,
    /// Width and height of the camera's and the projector's images, as the first usable pose has
    /// them.
    pub(super) sizes: Option<[[u32; 2]; 2]>,
    pub(super) nominal: Option<Rig>,
    pub(super) noise: Option<NoiseModel>,
}

impl Session {
    /// Before the first pose; `names` are those of all, in order.
    pub(super) fn new(out: &Path, names: &[String]) -> Self {
        let files = picture_names(names);
        Self {
            out: out.to_owned(),
            names: names.iter().cloned().zip(files).collect(),
            pictures: Vec::new(),
            places: Vec::new(),
            poses: Vec::new(),
            missed: Vec::new(),
            sizes: None,
            nominal: None,
            noise: None,
        }
    }

    /// Takes a pose, by its place among the names: a mistake in it, a picture without a board and
    /// images of another size than those before it are noted, and the other poses go on.
    ///
    /// # Errors
    /// A picture that cannot be written.
    pub(super) fn take(&mut self, place: usize, looked: Result<Looked>) -> Result<()> {
        let looked = match looked {
            Ok(looked) => looked,
            Err(why) => {
                self.miss(place, why.to_string());
                return Ok(());
            }
        };
        if let Some((name, file)) = self.names.get(place) {
            let path = self.out.join(file);
            looked.picture.save(&path).map_err(|e| match e {
                image::ImageError::IoError(e) => Error::io(&path, e),
                e => Error::device(format!("{}: {e}", path.display())),
            })?;
            self.pictures.push((name.clone(), file.clone()));
        }
        let sizes = [looked.camera_px, looked.projector_px];
        let wanted = *self.sizes.get_or_insert(sizes);
        match looked.found {
            _ if sizes != wanted => self.miss(place, other_size(sizes, wanted)),
            Err(why) => self.miss(place, why),
            Ok(data) => {
                self.places.push(place);
                self.poses.push(data);
                self.nominal = self.nominal.or(looked.nominal);
                self.noise = self.noise.or(looked.noise);
            }
        }
        Ok(())
    }

    fn miss(&mut self, place: usize, why: String) {
        let name = self.names.get(place).map(|(name, _)| name.clone());
        self.missed.push(Missed {
            name: name.unwrap_or_default(),
            why,
        });
    }
}

fn other_size(found: [[u32; 2]; 2], wanted: [[u32; 2]; 2]) -> String {
    let words = |[camera, projector]: [[u32; 2]; 2]| {
        format!(
            "{} x {} pixels before a projector of {} x {}",
            camera[0], camera[1], projector[0], projector[1]
        )
    };
    format!(
        "images of another size: {}; wanted: {}, as the first pose has",
        words(found),
        words(wanted)
    )
}
