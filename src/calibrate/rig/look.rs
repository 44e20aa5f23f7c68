//! Decodes the frames of a pose and detects the board in them.

use super::PoseData;
use super::sight::sight_with_stop;
use crate::board::{BoardImage, NotFound, Seen, draw, find};
use image::RgbImage;
use phasmid_core::Stop;
use phasmid_core::error::{Error, Result};
use phasmid_decode::{Decoder, Options};
use phasmid_geometry::{Board, NoiseModel, Rig};
use phasmid_pattern::{Axis, Image, Manifest};

/// Results of decoding the images of one pose.
#[derive(Debug, Clone)]
pub struct Looked {
    /// The points of the board, or why the board was not found.
    pub found: Result<PoseData, NotFound>,
    /// The image, with the detected points drawn into it.
    pub picture: RgbImage,
    /// Fraction of the pixels that are saturated in at least one frame.
    pub saturated: f64,
    /// Width and height of the camera's image.
    pub camera_px: [u32; 2],
    /// Width and height of the projector's image.
    pub projector_px: [u32; 2],
    /// The calibration that the device reports, or that was stored with the capture.
    pub nominal: Option<Rig>,
    /// The camera's noise model, if known.
    pub noise: Option<NoiseModel>,
}

/// Decodes a pose's frames and detects the board in them.
///
/// # Errors
/// Returns an error if the sequence does not encode both axes, or the frames do not match the sequence.
pub fn look(
    board: &Board,
    name: &str,
    manifest: &Manifest,
    images: &[Image],
    nominal: Option<Rig>,
) -> Result<Looked> {
    look_with_stop(board, name, manifest, images, nominal, &Stop::default())
}

/// Like [`look`], but another thread can end the call early.
///
/// # Errors
/// Returns [`Error::Interrupted`] soon after a stop is requested, and the errors of [`look`].
pub fn look_with_stop(
    board: &Board,
    name: &str,
    manifest: &Manifest,
    images: &[Image],
    nominal: Option<Rig>,
    stop: &Stop,
) -> Result<Looked> {
    let options = Options {
        noise: nominal.and_then(|rig| rig.noise),
        ..Options::default()
    };
    // Decode without a rig, because no points are triangulated here.
    let size @ [width, height] = Image::common_size(images)?;
    let decoder = Decoder::new(manifest, width, height, None, options)?;
    let decoded = decoder.with_stop(stop.clone()).decode(images)?;
    for axis in [Axis::X, Axis::Y] {
        if decoded.axis(axis).is_none() {
            return Err(Error::input(
                "sequence",
                format!("no patterns that encode the projector's {axis} coordinate"),
                "fringes or Gray code along x and along y",
            ));
        }
    }
    let picture =
        BoardImage::from_frames(manifest, images, &decoded.noise.unwrap_or(guess(images)))?;
    stop.check()?;
    let found = sight_with_stop(board, name, &picture, &decoded, stop);
    if found == Err(NotFound::Interrupted) {
        return Err(Error::Interrupted);
    }
    stop.check()?;
    let saturated = picture.level.iter().filter(|level| level.is_nan()).count();
    let seen = found.as_ref().map_or(&[][..], |data| &data.seen);
    Ok(Looked {
        picture: draw(&picture, board, seen),
        found,
        saturated: saturated as f64 / picture.level.len().max(1) as f64,
        camera_px: size.map(|side| side as u32),
        projector_px: [manifest.projector.width_px, manifest.projector.height_px],
        nominal,
        noise: decoded.noise,
    })
}

/// Detects the board in one image, such as a frame of a free-running camera. The result has no
/// projector coordinates.
///
/// # Errors
/// Returns an error if the image has no pixels; the inner error says why no board was found.
pub fn look_at_photograph(board: &Board, image: &Image) -> Result<Result<Vec<Seen>, NotFound>> {
    let noise = guess(std::slice::from_ref(image));
    Ok(find(board, &BoardImage::from_photograph(image, &noise)?))
}

/// Returns a default noise model if neither a calibration nor the frames provide one: only read noise,
/// two thousandths of full scale.
fn guess(images: &[Image]) -> NoiseModel {
    let full = images.iter().map(Image::full_scale).max();
    let full = f64::from(full.unwrap_or(u16::MAX));
    NoiseModel {
        gain_dn_per_e: 0.0,
        read_noise_dn: full * 2e-3,
        black_level_dn: 0.0,
        saturation_dn: full,
    }
}
