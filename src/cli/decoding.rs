//! The option `--held`, and warnings and errors of commands that decode.

use phasmid_core::error::{Error, Result};
use phasmid_decode::{Held, Known, check_sequence, doubt_of_fringes};
use phasmid_geometry::Rig;
use phasmid_pattern::{Image, Manifest};
use std::path::Path;

/// Treatment of the error due to held projector pixels.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
pub(super) enum HeldArg {
    /// Neither report nor correct the error
    Off,
    /// Report the error without changing the coordinates
    State,
    /// Correct each pixel using its own coordinate alone, and report the remaining error
    Correct,
    /// Correct each pixel using the smooth surface around it: far better below one projector pixel
    /// per camera pixel, where however ripples of 6 to 12 pixels lose up to half of their amplitude
    Smooth,
}

impl From<HeldArg> for Held {
    fn from(how: HeldArg) -> Self {
        match how {
            HeldArg::Off => Self::Off,
            HeldArg::State => Self::State,
            HeldArg::Correct => Self::Correct,
            HeldArg::Smooth => Self::Smooth,
        }
    }
}

/// Checks whether the images match the patterns of their sequence, with the noise model of a
/// calibration if there is one. If not, prints and returns the reason for doubt. By default the
/// doubt is only a warning, because a projector with a nonlinear response can cause it.
///
/// # Errors
/// With `strict`, returns the reason as an error.
pub(super) fn doubt(
    place: &Path,
    manifest: &Manifest,
    images: &[Image],
    calibration: Option<&Rig>,
    strict: bool,
) -> Result<Option<String>> {
    let known = Known::new(false, calibration);
    let of_sequence = check_sequence(manifest, images, known).err();
    let Some(why) = of_sequence.or_else(|| doubt_of_fringes(manifest, images, known)) else {
        return Ok(None);
    };
    let why = why.to_string();
    if strict {
        let expected = "images of this sequence in order";
        return Err(Error::input(place.display(), why, expected));
    }
    eprintln!("phasmid: {}: {why}", place.display());
    Ok(Some(why))
}

/// Replaces the word `calibration` as the place of an error by the file's path.
pub(super) fn name_calibration(error: Error, calibration: Option<&Path>) -> Error {
    match (error, calibration) {
        (
            Error::Input {
                place,
                found,
                expected,
            },
            Some(path),
        ) => {
            let place = match place.strip_prefix("calibration: ") {
                Some(field) => format!("{}: {field}", path.display()),
                None => place,
            };
            Error::input(place, found, expected)
        }
        (other, _) => other,
    }
}
