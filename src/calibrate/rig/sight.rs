//! One pose: the board in its picture, and the projector's coordinates about every point.

use crate::board::lit::{LocalFit, Unread, local_fits};
use crate::board::{NotFound, Picture, Seen, Sighting, find};
use crate::solve::PoseSightings;
use glam::DVec2;
use phasmid_decode::Decoded;
use phasmid_geometry::Board;

/// What a calibration keeps of a pose: some hundred bytes for each point.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseData {
    /// What the user calls the pose.
    pub name: String,
    /// The board's points as they were found.
    pub seen: Vec<Seen>,
    /// The projector's coordinates about each of them, or why there are none.
    pub fits: Vec<Result<LocalFit, Unread>>,
}

/// Finds the board in a pose's picture and reads the projector's coordinates about its points.
///
/// # Errors
/// A picture that shows no board, or another, or leaves open which way round it is.
pub fn sight(
    board: &Board,
    name: &str,
    picture: &Picture,
    decoded: &Decoded,
) -> Result<PoseData, NotFound> {
    let seen = find(board, picture)?;
    let fits = local_fits(board, &seen, decoded);
    Ok(PoseData {
        name: name.to_owned(),
        seen,
        fits,
    })
}

impl PoseData {
    /// Points about which the projector's coordinates are known.
    pub fn lit(&self) -> usize {
        self.fits.iter().flatten().count()
    }

    /// What the solver takes, with each point `bias` pixels from where its centroid is.
    pub(super) fn sightings(&self, bias: &[DVec2]) -> PoseSightings {
        let sighting = |((seen, fit), bias): ((&Seen, &Result<LocalFit, Unread>), &DVec2)| {
            let camera_px = seen.px - *bias;
            Sighting {
                index: seen.index,
                camera_px,
                camera_covariance: seen.covariance,
                projector: fit.as_ref().ok().map(|fit| fit.at(camera_px)),
            }
        };
        let points = self.seen.iter().zip(&self.fits).zip(bias);
        PoseSightings {
            name: self.name.clone(),
            sightings: points.map(sighting).collect(),
        }
    }
}
