//! Frames from image files: PNG of 8 and 16 bits, BMP, TIFF; colour becomes luma.

use super::plan::Plan;
use super::samples::{FrameStack, Samples};
use crate::error::{Error, Result};
use crate::pattern::{MAX_SIDE_PX, Manifest};
use image::{DynamicImage, ImageReader, Limits};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Bytes of samples that a sequence may have in memory.
const MAX_BYTES: u64 = 4 << 30;

/// Frames of one size in memory, in the manifest's order.
#[derive(Debug)]
pub struct LoadedFrames {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    frames: Pixels,
}

#[derive(Debug)]
enum Pixels {
    U8(Vec<Vec<u8>>),
    U16(Vec<Vec<u16>>),
}

impl LoadedFrames {
    /// The frames for the decoder.
    pub fn stack(&self) -> FrameStack<'_> {
        let frames = match &self.frames {
            Pixels::U8(f) => f.iter().map(|f| Samples::U8(f)).collect(),
            Pixels::U16(f) => f.iter().map(|f| Samples::U16(f)).collect(),
        };
        FrameStack::new(self.width, self.height, frames).expect("sizes and types were checked")
    }

    /// Bits of a sample.
    pub fn bits(&self) -> u32 {
        match self.frames {
            Pixels::U8(_) => 8,
            Pixels::U16(_) => 16,
        }
    }
}

/// Loads the photographs that `plan` needs from `folder`, in parallel.
///
/// # Errors
/// A frame without a file name, a missing or unreadable image, images of different sizes or sample
/// types, images too large for memory; each with the file's name.
pub fn load_frames(manifest: &Manifest, plan: &Plan, folder: &Path) -> Result<LoadedFrames> {
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
                format!("{} x {} as {} has", expected.0, expected.1, first.display()),
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
    let images: Vec<Option<DynamicImage>> = paths
        .par_iter()
        .map(|path| path.as_deref().map(open).transpose())
        .collect::<Result<_>>()?;
    let mut loaded = paths
        .iter()
        .flatten()
        .zip(images.iter().flatten().map(is_deep));
    let deep = loaded.next().is_some_and(|(_, deep)| deep);
    if let Some((path, _)) = loaded.find(|(_, other)| *other != deep) {
        let (found, others) = if deep { (8, 16) } else { (16, 8) };
        return Err(Error::input(
            path.display(),
            format!("{found}-bit samples"),
            format!("{others} bits as the frames before it have"),
        ));
    }
    let frames = if deep {
        Pixels::U16(
            images
                .into_par_iter()
                .map(|i| i.map(|i| i.into_luma16().into_raw()).unwrap_or_default())
                .collect(),
        )
    } else {
        Pixels::U8(
            images
                .into_par_iter()
                .map(|i| i.map(|i| i.into_luma8().into_raw()).unwrap_or_default())
                .collect(),
        )
    };
    Ok(LoadedFrames {
        width: w as usize,
        height: h as usize,
        frames,
    })
}

fn is_deep(image: &DynamicImage) -> bool {
    image.color().bytes_per_pixel() / image.color().channel_count() > 1
}

fn reader(path: &Path) -> Result<ImageReader<std::io::BufReader<std::fs::File>>> {
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
    if w.max(h) > MAX_SIDE_PX || w.min(h) == 0 {
        return Err(Error::input(
            path.display(),
            format!("{w} x {h} pixels"),
            format!("1 to {MAX_SIDE_PX} px a side"),
        ));
    }
    Ok((w, h))
}

fn open(path: &Path) -> Result<DynamicImage> {
    let image = reader(path)?.decode().map_err(|e| unreadable(path, &e))?;
    match image {
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => Err(Error::input(
            path.display(),
            "floating-point samples",
            "8- or 16-bit samples",
        )),
        image => Ok(image),
    }
}
