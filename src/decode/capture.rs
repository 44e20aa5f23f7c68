//! A capture holds the images of one sequence. It is stored as PNG images, the manifest that describes
//! them, and the calibration.

use super::{Decoded, Decoder, Options};
use image::{ImageBuffer, ImageFormat, Luma};
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file::{self, replace, write_image};
use phasmid_geometry::Rig;
use phasmid_pattern::{Image, Manifest, Pattern, Samples};
use rayon::prelude::*;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// File name of the manifest in a folder of frames.
pub const MANIFEST_FILE: &str = "sequence.toml";
/// File name of the calibration in a folder of frames.
pub const CALIBRATION_FILE: &str = "calibration.toml";

/// Header of a manifest with image patterns: a device does not return the files of these images.
const IMAGES_REMARK: &str = "# Patterns of kind \"image\" name images in the device, which a scan does not fetch. Decoding\n\
     # needs none of them; to project this sequence again, put them beside this file.\n\n";

/// Identity and time of a captured image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameInfo {
    /// Frame id, unique in the life of a device. For cameras without frame identity, a running count.
    pub id: u64,
    /// Position of the projected pattern in the sequence, if the camera reports it.
    pub pattern_index: Option<u32>,
    /// Start of the exposure in nanoseconds of the camera's clock.
    pub exposure_start_ns: u64,
    /// End of the exposure in nanoseconds of the camera's clock.
    pub exposure_end_ns: u64,
}

/// The images of a sequence, with their manifest and calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct Capture {
    /// The device's answer to `*IDN?`.
    pub idn: String,
    /// The projected sequence, one pattern per image.
    pub manifest: Manifest,
    /// The calibration read from the device, if it has one.
    pub calibration: Option<Rig>,
    /// The images in the manifest's order, all of the same size and bits per sample.
    pub images: Vec<Image>,
    /// Identity and time of each image; empty if they are not known.
    pub frames: Vec<FrameInfo>,
}

impl Capture {
    /// Creates the decoder for these images with the capture's calibration. Without a calibration it
    /// finds projector coordinates but no points.
    ///
    /// # Errors
    /// Returns an error if the images differ in size, if the sequence does not determine a projector
    /// coordinate, or if the calibration does not match it.
    pub fn decoder(&self, options: Options) -> Result<Decoder> {
        let [width, height] = Image::common_size(&self.images)?;
        let rig = self.calibration.as_ref();
        Decoder::new(&self.manifest, width, height, rig, options)
    }

    /// Decodes the images with the capture's calibration. Without a calibration the result has
    /// projector coordinates but no points.
    ///
    /// # Errors
    /// Returns the errors of [`Self::decoder`], and an error if the images do not match the sequence.
    pub fn decode(&self, options: Options) -> Result<(Decoder, Decoded)> {
        let decoder = self.decoder(options)?;
        let decoded = decoder.decode(&self.images)?;
        Ok((decoder, decoded))
    }

    /// Returns the file name that [`Self::write`] gives an image.
    fn file_name(&self, index: usize) -> PathBuf {
        let digits = self.images.len().saturating_sub(1).to_string().len().max(2);
        format!("frame_{index:0digits$}.png").into()
    }

    /// Checks, before a scan, that a folder does not already hold a capture.
    ///
    /// # Errors
    /// Returns an error if the folder holds a capture, unless `force` is set, or if a folder or device
    /// has the name of a file that the capture writes.
    pub fn check_folder(folder: &Path, force: bool) -> Result<()> {
        new_file::check_folder(folder, [""; 0], force)?;
        let mut names = Self::frames_in(folder)?;
        names.extend([MANIFEST_FILE, CALIBRATION_FILE].map(PathBuf::from));
        if force {
            return new_file::check_folder(folder, names, force);
        }
        let exists = |name: &&PathBuf| folder.join(name).symlink_metadata().is_ok();
        let Some(first) = names.iter().find(exists) else {
            return Ok(());
        };
        Err(Error::input(
            format!("--out {}", folder.display()),
            format!("{}, of an earlier capture", first.display()),
            "another folder, or --force to overwrite",
        ))
    }

    /// Returns the names of the frames of a capture in a folder, sorted; none if the folder does not
    /// exist.
    ///
    /// # Errors
    /// Returns the system's error.
    pub fn frames_in(folder: &Path) -> Result<Vec<PathBuf>> {
        let entries = match fs::read_dir(folder) {
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
            entries => entries.map_err(|e| Error::io(folder, e))?,
        };
        let mut frames = Vec::new();
        for entry in entries {
            let name = entry.map_err(|e| Error::io(folder, e))?.file_name();
            let text = name.to_string_lossy();
            let number = text
                .strip_prefix("frame_")
                .and_then(|rest| rest.strip_suffix(".png"));
            let is_number = |number: &str| number.bytes().all(|byte| byte.is_ascii_digit());
            if number.is_some_and(|number| number.len() >= 2 && is_number(number)) {
                frames.push(PathBuf::from(name));
            }
        }
        frames.sort_unstable();
        Ok(frames)
    }

    /// Writes the images as `frame_00.png` and so on (8 or 16 bits), `sequence.toml`, which lists
    /// them, and `calibration.toml` if there is a calibration. Creates the folder if it does not exist;
    /// files of the same names are replaced.
    ///
    /// # Errors
    /// Returns an error on I/O failure.
    pub fn write(&self, folder: &Path) -> Result<()> {
        fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        self.images
            .par_iter()
            .enumerate()
            .try_for_each(|(i, image)| write_png(image, &folder.join(self.file_name(i)), true))?;
        let mut manifest = self.manifest.clone();
        for (i, frame) in manifest.frame.iter_mut().enumerate() {
            frame.file = Some(self.file_name(i));
        }
        let write = |name: &str, text: String| {
            replace(&folder.join(name), |out| out.write_all(text.as_bytes()))
        };
        let pictures = manifest
            .frame
            .iter()
            .any(|frame| matches!(frame.pattern, Pattern::Image { .. }));
        let remark = if pictures { IMAGES_REMARK } else { "" };
        write(MANIFEST_FILE, format!("{remark}{}", manifest.to_toml()))?;
        match &self.calibration {
            Some(rig) => write(CALIBRATION_FILE, rig.to_toml()),
            None => Ok(()),
        }
    }
}

/// Writes an image as a greyscale PNG of 8 or 16 bits. An existing file is replaced only with
/// `force`.
///
/// # Errors
/// Returns an error on I/O failure, or if the file exists and `force` is not set.
pub fn write_png(image: &Image, path: &Path, force: bool) -> Result<()> {
    fn write<T: image::Primitive>(
        image: &Image,
        samples: &[T],
        path: &Path,
        force: bool,
    ) -> Result<()>
    where
        Luma<T>: image::PixelWithColorType<Subpixel = T>,
        [T]: image::EncodableLayout,
    {
        let (width, height) = (image.width() as u32, image.height() as u32);
        let picture = ImageBuffer::<Luma<T>, _>::from_raw(width, height, samples)
            .expect("an image has as many samples as pixels");
        write_image(path, force, |out| picture.write_to(out, ImageFormat::Png))
    }
    match image.samples() {
        Samples::U8(samples) => write(image, samples, path, force),
        Samples::U16(samples) => write(image, samples, path, force),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn written_capture_reads_back_equal() {
        let manifest = Manifest::parse(
            "[projector]\nwidth_px = 8\nheight_px = 4\n\
             [[frame]]\npattern = { kind = \"white\" }\n\
             [[frame]]\npattern = { kind = \"image\", file = \"dots.png\" }\n",
            "test",
        )
        .unwrap();
        let image = |id: u16| Image::new(2, 1, vec![0x1234, id]).unwrap();
        let capture = Capture {
            idn: "a,b,c,d".into(),
            manifest,
            calibration: None,
            images: vec![image(0), image(1)],
            frames: Vec::new(),
        };
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("scan");
        Capture::check_folder(&out, false).unwrap();
        capture.write(&out).unwrap();
        let back = Manifest::read(&out.join(MANIFEST_FILE)).unwrap();
        let text = fs::read_to_string(out.join(MANIFEST_FILE)).unwrap();
        assert!(text.starts_with("# Patterns of kind"), "{text}");
        let file = back.frame[1].file.clone().unwrap();
        assert_eq!(file, Path::new("frame_01.png"));
        let image = image::open(out.join(file)).unwrap().into_luma16();
        assert_eq!(image.as_raw(), &[0x1234, 1]);
        let error = Capture::check_folder(&out, false).unwrap_err();
        assert!(error.to_string().contains("--force"), "{error}");
        Capture::check_folder(&out, true).unwrap();
        fs::create_dir(out.join("frame_98.png")).unwrap();
        assert!(Capture::check_folder(&out, true).is_err());
        fs::remove_dir(out.join("frame_98.png")).unwrap();
        let frames = ["frame_00.png", "frame_01.png"].map(PathBuf::from);
        assert_eq!(Capture::frames_in(&out).unwrap(), frames);
    }
}
