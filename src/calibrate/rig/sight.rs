//! Data of one pose: the detected board and the projector's coordinates about its points.

use crate::board::lit::{LocalFit, Unread, local_fits};
use crate::board::{BoardImage, NotFound, Seen, Sighting, search};
use crate::solve::PoseSightings;
use glam::DVec2;
use phasmid_core::Stop;
use phasmid_decode::Decoded;
use phasmid_geometry::Board;

/// Data of a pose that a calibration keeps in memory; it takes a few hundred bytes per point.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseData {
    /// Name of the pose.
    pub name: String,
    /// The detected board points.
    pub seen: Vec<Seen>,
    /// For each point, the local fit of the projector's coordinates or the reason why it is
    /// missing.
    pub fits: Vec<Result<LocalFit, Unread>>,
}

/// Detects the board in the image of a pose and fits the projector's coordinates about its points.
///
/// # Errors
/// Returns an error if the image shows no board or another one, or if its orientation is ambiguous.
pub fn sight(
    board: &Board,
    name: &str,
    image: &BoardImage,
    decoded: &Decoded,
) -> Result<PoseData, NotFound> {
    sight_with_stop(board, name, image, decoded, &Stop::default())
}

/// Like [`sight`], but returns [`NotFound::Interrupted`] soon after a stop is requested.
pub(super) fn sight_with_stop(
    board: &Board,
    name: &str,
    image: &BoardImage,
    decoded: &Decoded,
    stop: &Stop,
) -> Result<PoseData, NotFound> {
    let seen = search(board, image, stop)?;
    stop.check().map_err(|_| NotFound::Interrupted)?;
    let fits = local_fits(board, &seen, decoded);
    Ok(PoseData {
        name: name.to_owned(),
        seen,
        fits,
    })
}

impl PoseData {
    /// Returns the number of points with projector coordinates.
    pub fn lit(&self) -> usize {
        self.fits.iter().flatten().count()
    }

    /// The solver's input, with `bias` (pixels) subtracted from each point.
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
