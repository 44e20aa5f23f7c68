//! Loads frames from image files: PNG of 8 and 16 bits, BMP, TIFF. Colour is converted to luma.

use super::plan::Plan;
use image::{DynamicImage, ImageReader, Limits};
use phasmid_core::error::{Error, Result};
use phasmid_core::file;
use phasmid_pattern::{Image, MAX_SIDE_PX, Manifest};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Maximum number of pixels of a frame: 8192 x 8192, above the 65 million of the largest common sensors.
/// Decoding takes about 30 bytes per pixel besides the frames, and without a limit a small compressed
/// file could claim any number of equal pixels.
const MAX_PIXELS: u64 = 1 << 26;
/// Maximum total size of a sequence's samples, in bytes.
const MAX_BYTES: u64 = 4 << 30;
/// Maximum total size of images being decoded, before conversion to luma, in bytes.
const MAX_DECODING: u64 = 1 << 30;
/// Bytes per pixel of the widest format, 16-bit RGBA.
const WIDEST_PIXEL: u64 = 8;

/// Loads the images that `plan` needs from `folder`, in parallel. They must have one size and one number
/// of bits per sample. The images that `plan` does not need are returned empty.
///
/// # Errors
/// Returns an error that names the file if a frame has no file name, if an image is missing or
/// unreadable, if images differ in size or sample type, or if they exceed the memory limit.
pub fn load_frames(manifest: &Manifest, plan: &Plan, folder: &Path) -> Result<Vec<Image>> {
    let mut paths: Vec<Option<PathBuf>> = Vec::new();
    for (i, frame) in manifest.frame.iter().enumerate() {
        paths.push(match &frame.file {
            _ if !plan.uses(i) => None,
            Some(file) => Some(folder.join(file)),
            None => {
                return Err(Error::input(
                    format!("sequence: frame[{i}].file"),
                    "no file name",
                    "the photograph of this pattern",
                ));
            }
        });
    }
    let sizes: Vec<_> = paths.par_iter().flatten().map(|p| (p, size(p))).collect();
    let mut common: Option<(&Path, (u32, u32))> = None;
    for (path, size) in sizes {
        let size = size?;
        let (first, expected) = *common.get_or_insert((path, size));
        if size != expected {
            return Err(Error::input(
                path.display(),
                format!("{} x {} pixels", size.0, size.1),
                format!(
                    "{} x {}, the size of {}",
                    expected.0,
                    expected.1,
                    first.display()
                ),
            ));
        }
    }
    let Some((_, (w, h))) = common else {
        return Err(Error::input(
            "sequence",
            "no frame to decode",
            "at least one",
        ));
    };
    let bytes = u64::from(w) * u64::from(h) * 2 * paths.iter().flatten().count() as u64;
    if bytes > MAX_BYTES {
        return Err(Error::input(
            folder.display(),
            format!("frames of {} MiB in all", bytes >> 20),
            format!("up to {} MiB", MAX_BYTES >> 20),
        ));
    }
    let mut images: Vec<Image> = Vec::with_capacity(paths.len());
    for some in paths.chunks(at_once(w, h)) {
        let opened = some
            .par_iter()
            .map(|path| path.as_deref().map_or_else(|| Ok(Image::default()), open));
        images.extend(opened.collect::<Result<Vec<_>>>()?);
    }
    let mut loaded = paths.iter().zip(&images);
    let mut depths = loaded
        .by_ref()
        .filter_map(|(path, image)| Some((path.as_ref()?, image.bits())));
    let common = depths.next().map(|(_, bits)| bits);
    if let Some((path, bits)) = depths.find(|(_, bits)| Some(*bits) != common) {
        return Err(Error::input(
            path.display(),
            format!("{bits}-bit samples"),
            format!("{} bits, like the frames before it", common.unwrap_or(bits)),
        ));
    }
    Ok(images)
}

/// Returns the columns and rows of the first image that `plan` needs from `folder`; `None` if it
/// cannot be read, which [`load_frames`] reports as an error.
pub fn frame_size(manifest: &Manifest, plan: &Plan, folder: &Path) -> Option<[u32; 2]> {
    let mut used = manifest.frame.iter().enumerate();
    let (_, frame) = used.find(|(i, _)| plan.uses(*i))?;
    let (width, height) = size(&folder.join(frame.file.as_ref()?)).ok()?;
    Some([width, height])
}

/// Number of images of this size that may be decoded at the same time.
fn at_once(width: u32, height: u32) -> usize {
    let picture = u64::from(width) * u64::from(height) * WIDEST_PIXEL;
    (MAX_DECODING / picture.max(1)).max(1) as usize
}

fn reader(path: &Path) -> Result<ImageReader<std::io::BufReader<std::fs::File>>> {
    file::regular(path)?;
    let mut reader = ImageReader::open(path)
        .and_then(ImageReader::with_guessed_format)
        .map_err(|e| Error::io(path, e))?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE_PX);
    limits.max_image_height = Some(MAX_SIDE_PX);
    limits.max_alloc = Some(MAX_BYTES);
    reader.limits(limits);
    Ok(reader)
}

fn unreadable(path: &Path, error: &image::ImageError) -> Error {
    Error::input(
        path.display(),
        error,
        format!("a PNG, BMP or TIFF image of up to {MAX_SIDE_PX} px a side"),
    )
}

fn size(path: &Path) -> Result<(u32, u32)> {
    let (w, h) = reader(path)?
        .into_dimensions()
        .map_err(|e| unreadable(path, &e))?;
    if w.max(h) > MAX_SIDE_PX || w.min(h) == 0 || u64::from(w) * u64::from(h) > MAX_PIXELS {
        return Err(Error::input(
            path.display(),
            format!("{w} x {h} pixels"),
            format!("1 to {MAX_SIDE_PX} px a side, and up to {MAX_PIXELS} pixels"),
        ));
    }
    Ok((w, h))
}

/// Reads an image and keeps only its brightness, to limit memory.
fn open(path: &Path) -> Result<Image> {
    let (w, h) = size(path)?;
    let mut reader = reader(path)?;
    // Limits the memory, because a file can contain more than its pixels, such as a colour profile.
    let mut limits = Limits::default();
    limits.max_alloc = Some((u64::from(w) * u64::from(h) * 16).max(1 << 20));
    reader.limits(limits);
    let image = reader.decode().map_err(|e| unreadable(path, &e))?;
    let color = image.color();
    match image {
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => Err(Error::input(
            path.display(),
            "floating-point samples",
            "8- or 16-bit samples",
        )),
        image if color.bytes_per_pixel() > color.channel_count() => {
            Image::new(w as usize, h as usize, image.into_luma16().into_raw())
        }
        image => Image::new(w as usize, h as usize, image.into_luma8().into_raw()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ImageBuffer, Rgba};

    #[test]
    fn colour_picture_is_converted_to_grey_when_opened() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("wide.png");
        let colour = Rgba([30000_u16, 30000, 30000, 65535]);
        ImageBuffer::from_pixel(5, 3, colour).save(&path).unwrap();
        // Two bytes per pixel are kept, as the limit for a sequence assumes, not the file's eight.
        let image = open(&path).unwrap();
        assert_eq!(image, Image::new(5, 3, vec![30000_u16; 15]).unwrap());
    }

    #[test]
    fn too_many_pixels_are_refused_before_they_are_decoded() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("bomb.png");
        image::GrayImage::new(16, 16).save(&path).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        // Sets width and height in the header to 16384 and updates its checksum; the file has far fewer
        // pixels.
        bytes[16..24].copy_from_slice(&[0, 0, 64, 0, 0, 0, 64, 0]);
        let checksum = crc(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&checksum.to_be_bytes());
        std::fs::write(&path, bytes).unwrap();
        let error = size(&path).unwrap_err().to_string();
        assert!(
            error.contains("bomb.png: 16384 x 16384 pixels; expected"),
            "{error}"
        );
        assert!(error.contains("up to 67108864 pixels"), "{error}");
    }

    /// The checksum of a PNG chunk.
    fn crc(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |c, _| {
                (c >> 1) ^ (0xedb8_8320 * (c & 1))
            })
        })
    }

    #[test]
    fn number_of_pictures_decoded_at_once_fits_memory() {
        for (side, count) in [(1024, 128), (8192, 2), (MAX_SIDE_PX, 1)] {
            assert_eq!(at_once(side, side), count, "{side}");
        }
    }
}
