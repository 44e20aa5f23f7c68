//! The rig that a device reports. It is the result of a simulated factory calibration and differs
//! from the true rig.
//!
//! The errors are one draw from the joint covariance of the parameters, for a calibration with a
//! board in 20 poses. Errors of the parameters are strongly correlated (a longer focal length is
//! nearly a more distant board), so draws that ignore the correlation would exaggerate errors of
//! depth several times.

use super::Profile;
use phasmid_core::error::{Error, Result};
use phasmid_core::philox::philox;
use phasmid_geometry::board_poses::{Wanted, poses};
use phasmid_geometry::parameters::{LENS, RIG};
use phasmid_geometry::{Board, Covariance, Pose, Rig};
use std::f64::consts::TAU;

/// Ratio of sizes of successive boards that are tried, beginning with the board of `[calibration]`.
const SMALLER: f64 = 0.7;
/// Maximum number of boards that are tried; the last one is a thousandth of the size of the first.
const BOARDS: i32 = 21;

impl Profile {
    /// Returns the rig that the device reports, in the camera's frame of the whole sensor: with
    /// errors drawn from the covariance of a calibration in 20 poses and with the covariance
    /// predicted at the result, or the exact rig if the profile requests it. Equal serial numbers
    /// give equal errors. Distortion coefficients that are zero in the profile have no error. The
    /// noise model is the sensor's: an EMVA 1288 measurement of a whole sensor determines it to 0.2
    /// %.
    ///
    /// # Errors
    /// Returns an error if the board cannot be shown to the rig in 20 poses, or if `corner_px` is
    /// so large that the drawn rig is impossible.
    ///
    /// ```
    /// use phasmid_profile::Profile;
    ///
    /// let profile = Profile::load("pmp-bench")?;
    /// let (truth, reported) = (profile.nominal_rig(), profile.factory_rig()?);
    /// let covariance = reported.covariance.expect("not exact");
    /// // Squared error in terms of the covariance, and the number of estimated parameters.
    /// let (square, count) = covariance.square(&reported.step_to(&truth));
    /// assert!(square / (count as f64) < 3.0);
    /// # Ok::<(), phasmid_core::error::Error>(())
    /// ```
    pub fn factory_rig(&self) -> Result<Rig> {
        let truth = self.nominal_rig();
        if self.factory_calibration.exact {
            return Ok(truth);
        }
        let refuse = |found: String| {
            Error::input(
                format!("profile {}: factory_calibration", self.name),
                found,
                "a rig that can be calibrated in 20 poses with the board of [calibration], or exact \
                 = true",
            )
        };
        let default = Board::DOTS.scaled(self.calibration.board_scale.unwrap_or(1.0));
        let wanted = Wanted {
            distance_mm: self.calibration.distance_mm,
            // Assume that a factory can measure dots of any size.
            least_dot_px: 0.0,
            ..Wanted::default()
        };
        // Use the largest of the boards that fits into the field of view.
        let mut fitting = Err(String::new());
        for smaller in 0..BOARDS {
            let board = default.scaled(SMALLER.powi(smaller));
            fitting = match poses(&board, &truth, &wanted) {
                Ok(poses) => Ok((board, poses)),
                Err(Error::Input { found, .. }) => Err(found),
                Err(other) => Err(other.to_string()),
            };
            if fitting.is_ok() {
                break;
            }
        }
        let (board, poses) = fitting.map_err(|found| refuse(format!("no board fits: {found}")))?;
        let spread = |rig: &Rig| self.spread(rig, &board, &poses);
        let undetermined = || refuse("poses that do not determine the rig".to_owned());
        let covariance = spread(&truth).ok_or_else(undetermined)?;
        let mut rig = truth.stepped(&covariance.step(&normals(&self.identity.serial)));
        rig.check().map_err(|violation| {
            let corner_px = self.factory_calibration.corner_px;
            let (field, found) = (violation.field, violation.found);
            refuse(format!(
                "a randomly drawn {field} of {found} with corner_px = {corner_px}"
            ))
        })?;
        // A factory does not know the true rig, so the stated covariance is that at its estimate.
        rig.covariance = Some(spread(&rig).ok_or_else(undetermined)?);
        Ok(rig)
    }

    fn spread(&self, rig: &Rig, board: &Board, poses: &[Pose]) -> Option<Covariance> {
        let mut estimated = [true; RIG];
        let nominal = [&self.camera.distortion, &self.projector.distortion];
        for (lens, distortion) in nominal.into_iter().enumerate() {
            let at = LENS * lens + 4;
            for (estimated, k) in estimated[at..at + 5].iter_mut().zip(distortion) {
                *estimated = *k != 0.0;
            }
        }
        let corner_px = self.factory_calibration.corner_px;
        Covariance::of_calibration(rig, board, poses, corner_px, &estimated)
    }
}

/// Returns independent standard normal numbers that a serial number determines (Box and Muller
/// 1958).
fn normals(serial: &str) -> [f64; RIG] {
    // FNV-1a, 64 bits.
    let hash = serial
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
    let key = [hash as u32, (hash >> 32) as u32];
    std::array::from_fn(|i| {
        let words = philox([i as u32, 0, 0, 0], key);
        let even = |word: u32| (f64::from(word) + 0.5) / 4_294_967_296.0;
        (-2.0 * even(words[0]).ln()).sqrt() * (TAU * even(words[1])).cos()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile(name: &str, serial: &str) -> Profile {
        let mut profile = Profile::load(name).unwrap();
        serial.clone_into(&mut profile.identity.serial);
        profile
    }

    #[test]
    fn the_serial_number_determines_the_errors() {
        let rig = |serial| profile("webcam-grey", serial).factory_rig().unwrap();
        assert_eq!(rig("0001"), rig("0001"));
        assert_ne!(rig("0001"), rig("0002"));
        let truth = profile("webcam-grey", "0001").nominal_rig();
        assert_eq!(rig("0001").noise, truth.noise);
        assert_eq!(rig("0001").camera.lens.distortion, [0.0; 5]);
    }

    #[test]
    fn an_exact_calibration_is_the_truth_without_covariance() {
        let mut profile = profile("pmp-real", "0001");
        profile.factory_calibration.exact = true;
        assert_eq!(profile.factory_rig().unwrap(), profile.nominal_rig());
    }

    #[test]
    fn errors_of_many_serial_numbers_are_as_large_as_their_covariances_say() {
        // A device without lens distortion and one with; the latter takes ten times as long per
        // serial number.
        for (name, serials) in [("dlp-evm", 200), ("pmp-real", 20)] {
            let (mut squares, mut count) = (0.0, 0);
            for serial in 0..serials {
                let profile = profile(name, &format!("{serial:04}"));
                let rig = profile.factory_rig().unwrap();
                let covariance = rig.covariance.unwrap();
                let (square, dof) = covariance.square(&rig.step_to(&profile.nominal_rig()));
                squares += square;
                count += dof;
            }
            let ratio = (squares / count as f64).sqrt();
            assert!((0.9..1.1).contains(&ratio), "{name}: {ratio}");
        }
    }

    #[test]
    fn errors_are_proportional_to_the_noise_of_corners() {
        let step = |corner_px| {
            let mut profile = profile("webcam-grey", "0007");
            profile.factory_calibration.corner_px = corner_px;
            let rig = profile.factory_rig().unwrap();
            profile.nominal_rig().step_to(&rig)
        };
        for (a, b) in step(0.01).iter().zip(step(0.1)) {
            assert!((10.0 * a - b).abs() <= 1e-6 * b.abs(), "{a} {b}");
        }
    }

    #[test]
    fn small_fields_are_calibrated_with_a_small_board() {
        let text = phasmid_device_profiles::PMP_BENCH;
        let small = |factor: f64| {
            let mut profile = Profile::parse(text, "p").unwrap();
            profile.projector.position_mm = profile.projector.position_mm.map(|mm| mm * factor);
            profile.calibration.distance_mm = profile.calibration.distance_mm.map(|mm| mm * factor);
            profile.factory_rig().unwrap().covariance.unwrap()
        };
        small(1.0);
        small(0.02);
    }

    #[test]
    fn rigs_that_cannot_be_calibrated_are_refused() {
        let mut away = profile("webcam-grey", "0001");
        away.projector.rotation_deg = [0.0, 180.0, 0.0];
        let message = away.factory_rig().unwrap_err().to_string();
        assert!(
            message.contains("webcam-grey: factory_calibration: "),
            "{message}"
        );
        assert!(message.contains("exact = true"), "{message}");
        assert_eq!(message.matches("expected").count(), 1, "{message}");
        let text = phasmid_device_profiles::WEBCAM_GREY;
        let text = format!("{text}\n[factory_calibration]\ncorner_px = 0.0\n");
        let message = Profile::parse(&text, "p").unwrap_err().to_string();
        assert!(
            message.contains("factory_calibration.corner_px"),
            "{message}"
        );
    }
}
