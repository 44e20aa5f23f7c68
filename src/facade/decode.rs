//! Decodes captures to surfaces, and compares surfaces with the truth.

use phasmid_core::error::{Error, Result};
use phasmid_decode::{Capture, Decoded, Decoder, Options, Summary};
use phasmid_device::Truth;
use phasmid_geometry::{Cloud, Rig, ply};
use phasmid_pattern::{Image, Manifest};
use phasmid_study::score::{Score, score};
use std::path::Path;

/// A decoded capture.
#[derive(Debug)]
pub struct Decoding {
    /// The projected sequence.
    pub manifest: Manifest,
    /// The decoder, for further captures of the same sequence, size and calibration.
    pub decoder: Decoder,
    /// Per pixel, row by row: projector coordinates, depth in millimetres in the camera's frame, a
    /// standard deviation for each, and the reason if a pixel was rejected.
    pub maps: Decoded,
}

impl Decoding {
    /// Returns the measured points, in the rig's frame in millimetres, with a standard deviation and a
    /// brightness for each.
    pub fn cloud(&self) -> Cloud {
        self.decoder.cloud(&self.maps)
    }

    /// Returns figures of the result, as `phasmid decode` prints them.
    pub fn summary(&self) -> Summary {
        Summary::new(&self.decoder, &self.maps)
    }

    /// Writes the measured points as a PLY file, which is replaced if it exists.
    ///
    /// # Errors
    /// Returns the system's error.
    pub fn write_ply(&self, path: impl AsRef<Path>) -> Result<()> {
        ply::write_cloud(path.as_ref(), &self.cloud())
    }
}

/// Decodes a capture with a calibration. Without a calibration, the result has projector coordinates but
/// no depth.
///
/// ```
/// use phasmid::{DecodeOptions, Device};
/// let mut device = Device::builder().profile("webcam-grey").scene("sphere").seed(1).build()?;
/// let capture = device.scan("quick-4")?;
/// let rig = device.factory_calibration()?;
/// let decoding = phasmid::decode(&capture, &rig, &DecodeOptions::default())?;
/// assert!(decoding.cloud().points.len() > 10_000);
/// # Ok::<(), phasmid::Error>(())
/// ```
///
/// # Errors
/// Returns an error if the sequence does not determine a projector coordinate, or if the images or
/// the calibration do not match the sequence.
pub fn decode<'a>(
    capture: &Capture,
    rig: impl Into<Option<&'a Rig>>,
    options: &Options,
) -> Result<Decoding> {
    let [width, height] = Image::common_size(&capture.images)?;
    let decoder = Decoder::new(&capture.manifest, width, height, rig.into(), *options)?;
    let maps = decoder.decode(&capture.images)?;
    Ok(Decoding {
        manifest: capture.manifest.clone(),
        decoder,
        maps,
    })
}

/// Compares a measured surface with the truth of the scan; `rig` is the true rig
/// ([`Device::rig`](crate::Device::rig)). Inlier error, gross errors and coverage are separate figures.
///
/// ```
/// use phasmid::{DecodeOptions, Device};
/// let mut device = Device::builder()
///     .profile("webcam-grey")
///     .scene("sphere")
///     .exact_calibration(true)
///     .build()?;
/// let capture = device.scan("quick-4")?;
/// let decoding = phasmid::decode(&capture, &device.rig(), &DecodeOptions::default())?;
/// let score = phasmid::compare(&decoding, &device.truth()?, &device.rig())?;
/// assert!(score.coverage > 0.95 && score.gross_error_rate < 1e-3);
/// # Ok::<(), phasmid::Error>(())
/// ```
///
/// # Errors
/// Returns an error if the surface has no depth, or if the sizes differ.
pub fn compare(decoding: &Decoding, truth: &Truth, rig: &Rig) -> Result<Score> {
    if decoding.maps.depth.is_empty() {
        return Err(Error::input("decoding", "no depth", "one by a calibration"));
    }
    score(&decoding.maps, truth, &decoding.manifest, rig)
}
