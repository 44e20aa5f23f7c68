//! Collects the poses of one calibration: the points found in each, and an annotated image.

use super::look::Looked;
use phasmid_calibrate::report::image_names;
use phasmid_calibrate::rig::{Missed, PoseData};
use phasmid_core::error::Result;
use phasmid_core::new_file;
use phasmid_geometry::{NoiseModel, Rig};
use std::path::{Path, PathBuf};

/// Minimum number of points with a projector coordinate that a pose needs to constrain the projector.
const FEWEST_LIT: usize = 6;
/// Minimum fraction of saturated pixels that is mentioned in messages.
const SATURATED: f64 = 0.01;

/// Width and height of the camera's and of the projector's images.
type Sizes = [[u32; 2]; 2];

/// The poses received so far.
pub(super) struct Session {
    folder: PathBuf,
    /// For each expected pose: its name, and the name of its image file.
    names: Vec<(String, String)>,
    images: Vec<(String, String)>,
    found: Vec<Found>,
    /// Index of each pose that cannot be used, and the reason.
    missed: Vec<(usize, String)>,
}

/// A pose in which the board was found.
struct Found {
    place: usize,
    sizes: Sizes,
    data: PoseData,
    nominal: Option<Rig>,
    noise: Option<NoiseModel>,
    saturated: f64,
}

/// All poses of a calibration.
pub(super) struct Poses {
    /// For each pose with an image: its name, and the name of its image file.
    pub(super) images: Vec<(String, String)>,
    /// Indices of the poses with a board, among all poses.
    pub(super) places: Vec<usize>,
    pub(super) poses: Vec<PoseData>,
    pub(super) missed: Vec<Missed>,
    /// Warnings about the usable poses.
    pub(super) warnings: Vec<String>,
    pub(super) sizes: Sizes,
    pub(super) nominal: Option<Rig>,
    pub(super) noise: Option<NoiseModel>,
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
            found: Vec::new(),
            missed: Vec::new(),
        }
    }

    /// Adds a pose by its index among the names. A pose that is invalid or shows no board is noted, and
    /// the calibration continues with the others.
    ///
    /// # Errors
    /// Returns an error if the image cannot be written.
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
            new_file::write_image(&path, false, |out| {
                looked.picture.write_to(out, image::ImageFormat::Png)
            })?;
            self.images.push((name.clone(), file.clone()));
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

    /// Excludes poses whose images differ in size from most others, and returns the rest.
    pub(super) fn finish(self) -> Poses {
        let Self {
            names,
            images,
            found,
            mut missed,
            ..
        } = self;
        let many = |sizes: Sizes| found.iter().filter(|pose| pose.sizes == sizes).count();
        // Prefer the first of equal counts: `max_by_key` returns the last one, so reverse the
        // order.
        let most = found.iter().rev().max_by_key(|pose| many(pose.sizes));
        let sizes = most.map(|pose| pose.sizes).unwrap_or_default();
        let mut poses = Poses {
            images,
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

/// Returns a warning if too few points of the board are lit and pixels are saturated. The solver
/// reports other causes.
fn unlit(pose: &Found) -> Option<String> {
    let (lit, all) = (pose.data.lit(), pose.data.seen.len());
    let (name, why) = (&pose.data.name, saturation(pose.saturated));
    (lit < FEWEST_LIT && !why.is_empty())
        .then(|| format!("{name}: {lit} of its {all} points have a projector coordinate{why}"))
}

/// Describes saturated pixels; empty if there are few.
fn saturation(share: f64) -> String {
    match share >= SATURATED {
        true => format!(
            "; {:.0} % of the pixels are saturated: shorten the exposure",
            100.0 * share
        ),
        false => String::new(),
    }
}

fn other_size(found: Sizes, wanted: Sizes) -> String {
    let words = |[camera, projector]: Sizes| {
        format!(
            "camera {} x {}, projector {} x {} pixels",
            camera[0], camera[1], projector[0], projector[1]
        )
    };
    format!(
        "images of another size: {}; expected {}, as most poses have",
        words(found),
        words(wanted)
    )
}
