//! Calibration of a scanner from captures of a board.

use phasmid_calibrate::rig::{Calibration, Gathering, look};
use phasmid_calibrate::solve::Choice;
use phasmid_core::error::{Error, Result};
use phasmid_decode::Capture;
use phasmid_geometry::Board;

/// Calibrates a scanner from captures of a board in several poses, each of a sequence with patterns
/// along both axes. The rig is `solution.rig` of the result, with the covariance of its parameters; the
/// poses without a board are in `missed`.
///
/// The example `calibrate` of the repository shows an emulated device a board in eight poses.
///
/// # Errors
/// Returns an error if too few captures show the board, or if the poses do not determine the rig: at
/// least three with boards that are not parallel.
pub fn calibrate(captures: &[Capture], board: &Board, choice: Choice) -> Result<Calibration> {
    let names: Vec<String> = (0..captures.len()).map(|i| format!("pose {i}")).collect();
    let mut gathering = Gathering::new(names.clone());
    for (place, (capture, name)) in captures.iter().zip(&names).enumerate() {
        let (manifest, images) = (&capture.manifest, &capture.images);
        let looked = look(board, name, manifest, images, capture.calibration);
        gathering.take(place, looked);
    }
    let poses = gathering.finish();
    poses.calibrate(board, choice).map_err(|why| {
        let missed = poses
            .missed
            .iter()
            .map(|m| format!("; {}: {}", m.name, m.why));
        let missed: String = missed.collect();
        Error::input("captures", format!("{why}{missed}"), "other poses")
    })
}
