//! Options of `phasmid calibrate`.

use crate::cli::board_args::BoardArgs;
use crate::cli::options::{BackendArg, SetArgs};
use phasmid_calibrate::solve::Coefficients;
use std::path::PathBuf;
use std::str::FromStr;

/// Calibrate an emulated device, or any scanner from its captures, with images of a board in many
/// poses
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  phasmid calibrate --profile webcam-grey --poses 8 --out calibrated"
)]
pub(crate) struct Args {
    /// Device profile to calibrate: a built-in name or a TOML file. The emulated device is shown a
    /// board and scanned over its ports
    #[arg(long, required_unless_present = "captures")]
    pub(super) profile: Option<String>,
    #[command(flatten)]
    pub(super) set: SetArgs,
    /// Captures to calibrate from: a folder with one subfolder per pose, each with the images and
    /// the sequence.toml that `phasmid scan --no-decode` writes
    #[arg(long, value_name = "DIR", conflicts_with = "profile")]
    pub(super) captures: Option<PathBuf>,
    #[command(flatten)]
    pub(super) board: BoardArgs,
    /// Folder for the calibration and its report
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// Distortion coefficients of the camera to estimate: auto (as many as the data require), none,
    /// all, or some of k1,k2,p1,p2,k3
    #[arg(long, value_name = "WHICH", default_value = "auto")]
    pub(super) camera_distortion: Choice,
    /// Distortion coefficients of the projector to estimate, as for the camera
    #[arg(long, value_name = "WHICH", default_value = "auto")]
    pub(super) projector_distortion: Choice,
    /// Number of poses in which the board is shown, 1 to 500
    #[arg(
        long,
        value_name = "N",
        default_value_t = 20,
        conflicts_with = "captures"
    )]
    pub(super) poses: u32,
    /// Distance of the board in millimetres [default: the profile's, or where the fields of view of
    /// camera and projector meet]
    #[arg(long, value_name = "MM", conflicts_with = "captures")]
    pub(super) distance_mm: Option<f64>,
    /// Maximum tilt of the board in degrees, 1 to 60
    #[arg(
        long,
        value_name = "DEG",
        default_value_t = 45.0,
        conflicts_with = "captures"
    )]
    pub(super) max_tilt_deg: f64,
    /// Seed of the poses and of the noise
    #[arg(long, default_value_t = 1, conflicts_with = "captures")]
    pub(super) seed: u64,
    /// Render without sensor noise
    #[arg(long, conflicts_with = "captures")]
    pub(super) no_noise: bool,
    /// Rays per pixel: 1, 4, 16 or 64
    #[arg(
        long,
        value_name = "N",
        default_value_t = 1,
        conflicts_with = "captures"
    )]
    pub(super) samples: u32,
    /// Where the render passes run
    #[arg(long, value_enum, default_value_t = BackendArg::Cpu, conflicts_with = "captures")]
    pub(super) backend: BackendArg,
    /// Keep the frames of each pose in the folder captures, as `phasmid scan` writes them
    #[arg(long, conflicts_with = "captures")]
    pub(super) keep_captures: bool,
    /// Overwrite an earlier calibration
    #[arg(long)]
    pub(super) force: bool,
    /// Print the results as JSON
    #[arg(long)]
    pub(super) json: bool,
}

/// The names of the coefficients in OpenCV's order.
const NAMES: [&str; 5] = ["k1", "k2", "p1", "p2", "k3"];

/// The coefficients that `--camera-distortion` or `--projector-distortion` selects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Choice(pub(super) Coefficients);

impl FromStr for Choice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text {
            "auto" => return Ok(Self(Coefficients::Auto)),
            "none" => return Ok(Self(Coefficients::Fixed([false; 5]))),
            "all" => return Ok(Self(Coefficients::Fixed([true; 5]))),
            _ => {}
        }
        let mut chosen = [false; 5];
        for name in text.split(',') {
            let place = NAMES.iter().position(|known| *known == name.trim());
            let place = place.ok_or_else(|| {
                format!("unknown {name:?}; expected auto, none, all, or some of k1,k2,p1,p2,k3")
            })?;
            chosen[place] = true;
        }
        Ok(Self(Coefficients::Fixed(chosen)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accepts_words_and_lists_of_coefficients() {
        let choice = |text: &str| text.parse::<Choice>().map(|choice| choice.0);
        assert_eq!(choice("auto"), Ok(Coefficients::Auto));
        assert_eq!(choice("none"), Ok(Coefficients::Fixed([false; 5])));
        assert_eq!(choice("all"), Ok(Coefficients::Fixed([true; 5])));
        let some = Coefficients::Fixed([true, false, false, true, false]);
        assert_eq!(choice("k1,p2"), Ok(some));
        assert_eq!(choice("p2, k1"), Ok(some));
        for bad in ["", "k4", "k1,", "k1;k2", "Auto"] {
            assert!(choice(bad).unwrap_err().contains("k1,k2,p1,p2,k3"), "{bad}");
        }
    }
}
