//! The poses of one calibration as they come: what was found in each, and a picture of it.

use super::look::Looked;
use phasmid_calibrate::report::picture_names;
use phasmid_calibrate::rig::{Missed, PoseData};
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{NoiseModel, Rig};
use std::path::{Path, PathBuf};

/// A pose tells something of the projector from this many points in its light on.
const FEWEST_LIT: usize = 6;
/// Share of saturated pixels from which they are worth a word.
const SATURATED: f64 = 0.01;

/// Width and height of the camera's and of the projector's images.
type Sizes = [[u32; 2]; 2];

/// What is known of the poses so far.
pub(super) struct Session {
    folder: PathBuf,
    /// Name of each pose that is to come, and of the picture that there will be of it.
    names: Vec<(String, String)>,
    pictures: Vec<(String, String)>,
    found: Vec<Found>,
    /// Places of the poses that cannot be used, and why.
    missed: Vec<(usize, String)>,
}

/// A pose with a board.
struct Found {
    place: usize,
    sizes: Sizes,
    data: PoseData,
    nominal: Option<Rig>,
    noise: Option<NoiseModel>,
    saturated: f64,
}

/// The poses, when all have come.
pub(super) struct Poses {
    /// Names of the poses that there are pictures of, and of these.
    pub(super) pictures: Vec<(String, String)>,
    /// Places of the poses with a board among all.
    pub(super) places: Vec<usize>,
    pub(super) poses: Vec<PoseData>,
    pub(super) missed: Vec<Missed>,
    /// What is odd about the others.
    pub(super) warnings: Vec<String>,
    pub(super) sizes: Sizes,
    pub(super) nominal: Option<Rig>,
    pub(super) noise: Option<NoiseModel>,
}

impl Session {
    /// Before the first pose; `names` are those of all, in order, and pictures go to `folder`.
    pub(super) fn new(folder: &Path, names: &[String]) -> Self {
        let files = picture_names(names);
        Self {
            folder: folder.to_owned(),
            names: names.iter().cloned().zip(files).collect(),
            pictures: Vec::new(),
            found: Vec::new(),
            missed: Vec::new(),
        }
    }

    /// Takes a pose, by its place among the names: a mistake in it and a picture without a board are
    /// noted, and the other poses go on.
    ///
    /// # Errors
    /// A picture that cannot be written.
    pub(super) fn take(&mut self, place: usize, looked: Result<Looked>) -> Result<()> {
        let looked = match looked {
            Ok(looked) => looked,
            Err(why) => {
                self.missed.push((place, why.to_string()));
                return Ok(());
            }
        };
        if let Some((name, file)) = self.names.get(place) {
            let path = self.folder.join(file);
            looked.picture.save(&path).map_err(|e| match e {
                image::ImageError::IoError(e) => Error::io(&path, e),
                e => Error::device(format!("{}: {e}", path.display())),
            })?;
            self.pictures.push((name.clone(), file.clone()));
        }
        match looked.found {
            Err(why) => {
                let why = format!("{why}{}", saturation(looked.saturated));
                self.missed.push((place, why));
            }
            Ok(data) => self.found.push(Found {
                place,
                sizes: [looked.camera_px, looked.projector_px],
                data,
                nominal: looked.nominal,
                noise: looked.noise,
                saturated: looked.saturated,
            }),
        }
        Ok(())
    }

    /// Sorts out the poses whose images have another size than most.
    pub(super) fn finish(self) -> Poses {
        let Self {
            names,
            pictures,
            found,
            mut missed,
            ..
        } = self;
        let many = |sizes: Sizes| found.iter().filter(|pose| pose.sizes == sizes).count();
        // The first of those that are equally many.
        let most = found.iter().rev().max_by_key(|pose| many(pose.sizes));
        let sizes = most.map(|pose| pose.sizes).unwrap_or_default();
        let mut poses = Poses {
            pictures,
            places: Vec::new(),
            poses: Vec::new(),
            missed: Vec::new(),
            warnings: Vec::new(),
            sizes,
            nominal: None,
            noise: None,
        };
        for pose in found {
            if pose.sizes != sizes {
                missed.push((pose.place, other_size(pose.sizes, sizes)));
                continue;
            }
            poses.warnings.extend(unlit(&pose));
            poses.places.push(pose.place);
            poses.poses.push(pose.data);
            poses.nominal = poses.nominal.or(pose.nominal);
            poses.noise = poses.noise.or(pose.noise);
        }
        missed.sort_by_key(|(place, _)| *place);
        let named = |(place, why): (usize, String)| Missed {
            name: names
                .get(place)
                .map(|(name, _)| name.clone())
                .unwrap_or_default(),
            why,
        };
        poses.missed = missed.into_iter().map(named).collect();
        poses
    }
}

/// A pose with a board that is hardly lit and saturated; other reasons the fits tell themselves.
fn unlit(pose: &Found) -> Option<String> {
    let (lit, all) = (pose.data.lit(), pose.data.seen.len());
    let (name, why) = (&pose.data.name, saturation(pose.saturated));
    (lit < FEWEST_LIT && !why.is_empty())
        .then(|| format!("{name}: {lit} of its {all} points have a projector coordinate{why}"))
}

/// Words on pixels that are saturated, where they are many.
fn saturation(share: f64) -> String {
    match share >= SATURATED {
        true => format!(
            "; {:.0} % of the pixels are saturated, wanted: a shorter exposure",
            100.0 * share
        ),
        false => String::new(),
    }
}

fn other_size(found: Sizes, wanted: Sizes) -> String {
    let words = |[camera, projector]: Sizes| {
        format!(
            "{} x {} pixels before a projector of {} x {}",
            camera[0], camera[1], projector[0], projector[1]
        )
    };
    format!(
        "images of another size: {}; wanted: {}, as most poses have",
        words(found),
        words(wanted)
    )
}
