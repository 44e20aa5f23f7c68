//! Calibration of a scanner from captures of a board.

use phasmid_calibrate::rig::{Calibration, Gathering, look_with_stop};
use phasmid_calibrate::solve::{Choice, Unsolved};
use phasmid_core::Stop;
use phasmid_core::error::{Error, Result};
use phasmid_decode::Capture;
use phasmid_geometry::Board;

/// Calibrates a scanner from captures of a board, one capture for each pose of the board. The captured
/// sequence must have patterns along both axes. In the result, `solution.rig` is the rig, with the
/// covariance of its parameters, and `missed` lists the poses without a board.
///
/// The example `calibrate` of the repository shows an emulated device a board in eight poses.
///
/// # Errors
/// Returns an error if too few captures show the board, or if the poses do not determine the rig:
/// at least three poses that are not parallel are needed. The error's source is an [`Unsolved`].
pub fn calibrate(captures: &[Capture], board: &Board, choice: Choice) -> Result<Calibration> {
    calibrate_with_stop(captures, board, choice, &Stop::default())
}

/// Calibrates like [`calibrate`]; another thread can end the calculation early.
///
/// ```
/// use phasmid::calibrate::solve::Choice;
/// use phasmid::{Error, Stop, calibrate_with_stop, geometry::Board};
/// let stop = Stop::default();
/// stop.ask();
/// let ended = calibrate_with_stop(&[], &Board::DOTS, Choice::default(), &stop);
/// assert!(matches!(ended, Err(Error::Interrupted)));
/// ```
///
/// # Errors
/// Returns [`Error::Interrupted`] soon after a stop is requested, and the errors of [`calibrate`].
pub fn calibrate_with_stop(
    captures: &[Capture],
    board: &Board,
    choice: Choice,
    stop: &Stop,
) -> Result<Calibration> {
    let names: Vec<String> = (0..captures.len()).map(|i| format!("pose {i}")).collect();
    let mut gathering = Gathering::new(names.clone());
    for (place, (capture, name)) in captures.iter().zip(&names).enumerate() {
        let (manifest, images) = (&capture.manifest, &capture.images);
        let looked = look_with_stop(board, name, manifest, images, capture.calibration, stop);
        if let Err(Error::Interrupted) = looked {
            return Err(Error::Interrupted);
        }
        gathering.take(place, looked);
    }
    let poses = gathering.finish();
    let solved = poses.calibrate_with_stop(board, choice, stop);
    solved.map_err(|why| {
        if why == Unsolved::Interrupted {
            return Error::Interrupted;
        }
        let missed = poses
            .missed
            .iter()
            .map(|m| format!("; {}: {}", m.name, m.why));
        let missed: String = missed.collect();
        let message = format!("captures: {why}{missed}; expected other poses");
        Error::rejected(message, why)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Device;
    use phasmid_profile::{Profile, Scene, Shape};

    /// Returns `count` equal captures of a board in one pose.
    fn captures(profile: Profile, board: Board, count: usize) -> Vec<Capture> {
        let sequence = profile.calibration_sequence().unwrap().name.clone();
        let mut scene = Scene::load("board").unwrap();
        scene.object[0].shape = Shape::Board { board, ink: 0.06 };
        let builder = Device::builder().profile(profile).scene(scene);
        let capture = builder.build().unwrap().scan(&sequence).unwrap();
        vec![capture; count]
    }

    #[test]
    fn calibration_ends_when_another_thread_asks() {
        let profile = Profile::load("webcam-grey").unwrap();
        let board = Board::DOTS.scaled(profile.calibration.board_scale.unwrap_or(1.0));
        let captures = captures(profile, board, 3);
        let (stop, choice) = (Stop::default(), Choice::default());
        let once = || calibrate_with_stop(&captures, &board, choice, &stop);
        // Equal poses do not determine a rig.
        let error = once().unwrap_err();
        assert_eq!(error.exit_code(), 2);
        let why = std::error::Error::source(&error);
        assert!(why.is_some_and(|why| why.is::<Unsolved>()), "{error}");
        std::thread::scope(|threads| {
            threads.spawn(|| stop.ask());
            while !matches!(once(), Err(Error::Interrupted)) {}
        });
        for capture in &captures {
            let (manifest, images) = (&capture.manifest, &capture.images);
            let looked = look_with_stop(&board, "pose", manifest, images, None, &stop);
            assert!(matches!(looked, Err(Error::Interrupted)));
        }
    }
}
