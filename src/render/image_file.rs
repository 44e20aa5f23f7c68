//! Image files as patterns: decodes PNG, BMP or TIFF to greyscale, limited to the projector's size.

use image::{GrayImage, ImageReader, Limits};
use phasmid_core::error::{Error, Result};
use phasmid_core::file;
use phasmid_profile::Projector;
use std::io::Cursor;
use std::path::Path;

/// Maximum image file size in bytes.
const MAX_FILE: u64 = 64 << 20;

/// Decodes an image of at most the projector's size; `place` names it in messages.
///
/// # Errors
/// Returns an error if the bytes are not an image or if it is larger than the projector.
pub fn decode(bytes: &[u8], projector: &Projector, place: &str) -> Result<GrayImage> {
    let allowed = "a PNG, BMP or TIFF file no larger than the projector";
    let bad = |e: &dyn std::fmt::Display| Error::input(place, e, allowed);
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| bad(&e))?;
    let pixels = u64::from(projector.width_px) * u64::from(projector.height_px);
    let mut limits = Limits::default();
    limits.max_image_width = Some(projector.width_px);
    limits.max_image_height = Some(projector.height_px);
    limits.max_alloc = Some((pixels * 16).max(1 << 20));
    reader.limits(limits);
    Ok(reader.decode().map_err(|e| bad(&e))?.into_luma8())
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
