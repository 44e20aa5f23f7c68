//! Collects the poses of one calibration.

use super::look::Looked;
use super::unusable::{Sizes, Unusable, saturation};
use super::{Calibration, Missed, PoseData, Task, calibrate};
use crate::solve::{Choice, Unsolved};
use phasmid_core::Stop;
use phasmid_core::error::Result;
use phasmid_geometry::{Board, NoiseModel, Rig};

/// Minimum number of points with a projector coordinate that a pose needs to constrain the projector.
const FEWEST_LIT: usize = 6;

/// The poses received so far.
#[derive(Debug)]
pub struct Gathering {
    names: Vec<String>,
    found: Vec<Found>,
    /// Index of each pose that cannot be used, and the reason.
    missed: Vec<(usize, Unusable)>,
}

/// A pose in which the board was found.
#[derive(Debug)]
struct Found {
    place: usize,
    sizes: Sizes,
    data: PoseData,
    nominal: Option<Rig>,
    noise: Option<NoiseModel>,
    saturated: f64,
}

/// The poses of a calibration, all with images of the same sizes.
#[derive(Debug)]
pub struct Poses {
    /// Indices of the poses with a board, among all poses.
    pub places: Vec<usize>,
    /// The points of the board in each of these poses.
    pub poses: Vec<PoseData>,
    /// Poses that cannot be used.
    pub missed: Vec<Missed>,
    /// Warnings about the usable poses.
    pub warnings: Vec<String>,
    /// Width and height of the camera's and of the projector's images.
    pub sizes: Sizes,
    /// The calibration that came with the images, if any.
    pub nominal: Option<Rig>,
    /// The camera's noise model, if known.
    pub noise: Option<NoiseModel>,
}

impl Gathering {
    /// Starts without poses; `names` are the names of all expected poses in order.
    pub fn new(names: Vec<String>) -> Self {
        Self {
            names,
            found: Vec::new(),
            missed: Vec::new(),
        }
    }

    /// Adds a pose by its index among the names. A pose that is invalid or shows no board is noted,
    /// and the calibration continues with the other poses.
    pub fn take(&mut self, place: usize, looked: Result<Looked>) {
        let looked = match looked {
            Ok(looked) => looked,
            Err(why) => {
                self.missed
                    .push((place, Unusable::Invalid(why.to_string())));
                return;
            }
        };
        match looked.found {
            Err(why) => {
                let saturated = looked.saturated;
                self.missed
                    .push((place, Unusable::NoBoard { why, saturated }));
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
    }

    /// Excludes poses whose image size differs from the majority's, and returns the remaining poses.
    pub fn finish(self) -> Poses {
        let Self {
            names,
            found,
            mut missed,
        } = self;
        let many = |sizes: Sizes| found.iter().filter(|pose| pose.sizes == sizes).count();
        // Among equal counts prefer the first. `max_by_key` returns the last one, so reverse the
        // order.
        let most = found.iter().rev().max_by_key(|pose| many(pose.sizes));
        let sizes = most.map(|pose| pose.sizes).unwrap_or_default();
        let mut poses = Poses {
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
                let (found, expected) = (pose.sizes, sizes);
                missed.push((pose.place, Unusable::OtherSize { found, expected }));
                continue;
            }
            poses.warnings.extend(unlit(&pose));
            poses.places.push(pose.place);
            poses.poses.push(pose.data);
            poses.nominal = poses.nominal.or(pose.nominal);
            poses.noise = poses.noise.or(pose.noise);
        }
        missed.sort_by_key(|(place, _)| *place);
        let named = |(place, why): (usize, Unusable)| Missed {
            name: names.get(place).cloned().unwrap_or_default(),
            why,
        };
        poses.missed = missed.into_iter().map(named).collect();
        poses
    }
}

impl Poses {
    /// Solves for the rig.
    ///
    /// # Errors
    /// Returns an error if the poses do not determine the rig.
    pub fn calibrate(&self, board: &Board, choice: Choice) -> Result<Calibration, Unsolved> {
        self.calibrate_with_stop(board, choice, &Stop::default())
    }

    /// Like [`Self::calibrate`], but another thread can end the call early.
    ///
    /// # Errors
    /// Returns [`Unsolved::Interrupted`] soon after a stop is requested, and the errors of
    /// [`Self::calibrate`].
    pub fn calibrate_with_stop(
        &self,
        board: &Board,
        choice: Choice,
        stop: &Stop,
    ) -> Result<Calibration, Unsolved> {
        let [camera_px, projector_px] = self.sizes;
        let task = Task {
            board,
            camera_px,
            projector_px,
            nominal: self.nominal.as_ref(),
            noise: self.noise,
            choice,
            stop: Some(stop),
        };
        let mut calibration = calibrate(&task, &self.poses, self.missed.clone())?;
        calibration.warnings.extend(self.warnings.iter().cloned());
        Ok(calibration)
    }
}

/// Returns a warning if too few points of the board have projector coordinates and the cause is
/// saturation. The solver reports other causes.
fn unlit(pose: &Found) -> Option<String> {
    let (lit, all) = (pose.data.lit(), pose.data.seen.len());
    let (name, why) = (&pose.data.name, saturation(pose.saturated));
    (lit < FEWEST_LIT && !why.is_empty())
        .then(|| format!("{name}: {lit} of its {all} points have a projector coordinate{why}"))
}
