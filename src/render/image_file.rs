//! Image files as patterns: decodes PNG, BMP or TIFF files that have the projector's size to
//! greyscale.

use image::{DynamicImage, GrayImage, ImageDecoder, ImageReader, Limits};
use phasmid_core::error::{Error, Result};
use phasmid_core::file;
use phasmid_profile::Projector;
use std::io::Cursor;
use std::path::Path;

/// Maximum image file size in bytes.
const MAX_FILE: u64 = 64 << 20;

/// Decodes an image that must have the projector's size; `place` names the image in messages.
///
/// # Errors
/// Returns an error if the bytes are not an image or if it has another size, which is checked before
/// any pixel is decoded.
pub fn decode(bytes: &[u8], projector: &Projector, place: &str) -> Result<GrayImage> {
    let (width, height) = (projector.width_px, projector.height_px);
    let allowed = format!("a PNG, BMP or TIFF file of the projector's {width} x {height} pixels");
    let bad = |e: &dyn std::fmt::Display| Error::input(place, e, &allowed);
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| bad(&e))?;
    let pixels = u64::from(width) * u64::from(height);
    let mut limits = Limits::default();
    limits.max_alloc = Some((pixels * 16).max(1 << 20));
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|e| bad(&e))?;
    let found = decoder.dimensions();
    if found != (width, height) {
        return Err(bad(&format!("{} x {} pixels", found.0, found.1)));
    }
    let image = DynamicImage::from_decoder(decoder).map_err(|e| bad(&e))?;
    Ok(image.into_luma8())
}

/// Reads an image file.
///
/// # Errors
/// Returns an error if the file cannot be read, exceeds 64 MiB, or if [`decode`] fails.
pub fn read(path: &Path, projector: &Projector) -> Result<GrayImage> {
    decode(&bytes_of(path)?, projector, &path.display().to_string())
}

/// Reads the bytes of an image file.
///
/// # Errors
/// Returns an error if the file cannot be read or exceeds 64 MiB.
pub(crate) fn bytes_of(path: &Path) -> Result<Vec<u8>> {
    file::read(path, MAX_FILE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::ImageFormat;
    use phasmid_profile::Profile;

    #[test]
    fn size_is_checked_before_pixels_are_decoded() {
        let projector = Profile::load("webcam-grey").unwrap().projector;
        for format in [ImageFormat::Tiff, ImageFormat::Png] {
            let mut bytes = Cursor::new(Vec::new());
            let image = GrayImage::new(860, 480);
            image.write_to(&mut bytes, format).unwrap();
            let mut bytes = bytes.into_inner();
            if format == ImageFormat::Png {
                // The file ends before its pixel data, so only the check of the size can reject it.
                bytes.truncate(60);
            }
            let error = decode(&bytes, &projector, "big").unwrap_err().to_string();
            let expected = "big: 860 x 480 pixels; expected a PNG, BMP or TIFF file of the \
                            projector's 854 x 480 pixels";
            assert_eq!(error, expected);
        }
    }
}
