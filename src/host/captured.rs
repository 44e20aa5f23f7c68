//! The result of a scan and how it is stored: frames as images, the manifest that describes them,
//! and the calibration.

use super::consistency::{LEAST_FOLLOWING, doubt, following};
use image::{ImageBuffer, ImageFormat, Luma};
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file::{self, replace, write_image};
use phasmid_geometry::Rig;
use phasmid_pattern::{Manifest, Pattern};
use phasmid_protocol::{Frame, PixelFormat};
use rayon::prelude::*;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// File name of the manifest in a folder of frames.
pub const MANIFEST_FILE: &str = "sequence.toml";
/// File name of the calibration in a folder of frames.
pub const CALIBRATION_FILE: &str = "calibration.toml";

/// Header of a manifest whose patterns include images: a device does not return their files.
const IMAGES_REMARK: &str = "# Patterns of kind \"image\" name images in the device, which a scan does not fetch. Decoding\n\
     # needs none of them; to project this sequence again, put them beside this file.\n\n";

/// The frames of a sequence, with their manifest and calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct Captured {
    /// The device's answer to `*IDN?`.
    pub idn: String,
    /// The projected sequence, one pattern per frame.
    pub manifest: Manifest,
    /// The calibration read from the device, if it has one.
    pub calibration: Option<Rig>,
    /// The frames in the manifest's order, all of the same size and format, GREY or Y16.
    pub frames: Vec<Frame>,
}

impl Captured {
    /// Returns the file name that [`Self::write`] gives a frame.
    fn file_name(&self, index: usize) -> PathBuf {
        let digits = self.frames.len().saturating_sub(1).to_string().len().max(2);
        format!("frame_{index:0digits$}.png").into()
    }

    /// Rejects frames that show no surface: hardly any pixel follows the sequence, and most of the
    /// variation has another cause.
    ///
    /// # Errors
    /// Returns an error if the camera does not see the projected patterns.
    pub fn check_modulation(&self) -> Result<()> {
        match following(&self.manifest, &self.frames) {
            Some(found) if !found.is_shown() => Err(Error::device(format!(
                "the frames show no modulation: {:.2} % of the pixels follow the sequence, \
                 expected {} % or more; {}",
                100.0 * found.share,
                100.0 * LEAST_FOLLOWING,
                found.cause()
            ))),
            _ => Ok(()),
        }
    }

    /// Returns a warning about frames that follow their sequence, if there is one: fringes that are
    /// not sinusoidal.
    pub fn doubt(&self) -> Option<String> {
        doubt(&self.manifest, &self.frames)
    }

    /// Checks, before a scan, that a folder does not already hold a capture.
    ///
    /// # Errors
    /// Returns an error if the folder holds a capture, unless `force` is set, or if a folder or device
    /// has the name of one of its files.
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

    /// Returns the names of the frames of a capture in a folder, sorted; none if the folder does not exist.
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

    /// Writes the frames as `frame_00.png` and so on (8 or 16 bits), `sequence.toml`, which lists
    /// them, and `calibration.toml` if there is a calibration. Creates the folder if it does not exist;
    /// files of the same names are replaced.
    ///
    /// # Errors
    /// Returns an error on I/O failure, or if the data length of a frame does not match its size.
    pub fn write(&self, folder: &Path) -> Result<()> {
        fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        self.frames
            .par_iter()
            .enumerate()
            .try_for_each(|(i, frame)| write_png(frame, &folder.join(self.file_name(i)), true))?;
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

/// Writes a frame as a greyscale PNG of 8 or 16 bits. An existing file is replaced only with
/// `force`.
///
/// # Errors
/// Returns an error on I/O failure, if the data length of the frame does not match its size, or if
/// the file exists and `force` is not set.
pub fn write_png(frame: &Frame, path: &Path, force: bool) -> Result<()> {
    let (width, height) = (frame.width, frame.height);
    let wrong = || {
        Error::device(format!(
            "frame {}: its data length does not match its size",
            frame.id
        ))
    };
    if frame.format == PixelFormat::Y16 {
        let pixels: Vec<u16> = frame
            .data
            .chunks_exact(2)
            .map(|b| u16::from_le_bytes([b[0], b[1]]))
            .collect();
        let picture = ImageBuffer::<Luma<u16>, _>::from_raw(width, height, pixels);
        let picture = picture.ok_or_else(wrong)?;
        write_image(path, force, |out| picture.write_to(out, ImageFormat::Png))
    } else {
        let pixels = frame.data.as_slice();
        let picture = ImageBuffer::<Luma<u8>, _>::from_raw(width, height, pixels);
        let picture = picture.ok_or_else(wrong)?;
        write_image(path, force, |out| picture.write_to(out, ImageFormat::Png))
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
        let frame = |id: u64| Frame {
            id,
            pattern_index: Some(id as u32),
            width: 2,
            height: 1,
            format: PixelFormat::Y16,
            exposure_start_ns: 0,
            exposure_end_ns: 1,
            data: vec![0x34, 0x12, id as u8, 0],
        };
        let captured = Captured {
            idn: "a,b,c,d".into(),
            manifest,
            calibration: None,
            frames: vec![frame(0), frame(1)],
        };
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("scan");
        Captured::check_folder(&out, false).unwrap();
        captured.write(&out).unwrap();
        let back = Manifest::read(&out.join(MANIFEST_FILE)).unwrap();
        let text = fs::read_to_string(out.join(MANIFEST_FILE)).unwrap();
        assert!(text.starts_with("# Patterns of kind"), "{text}");
        let file = back.frame[1].file.clone().unwrap();
        assert_eq!(file, Path::new("frame_01.png"));
        let image = image::open(out.join(file)).unwrap().into_luma16();
        assert_eq!(image.as_raw(), &[0x1234, 1]);
        let error = Captured::check_folder(&out, false).unwrap_err();
        assert!(error.to_string().contains("--force"), "{error}");
        Captured::check_folder(&out, true).unwrap();
        fs::create_dir(out.join("frame_98.png")).unwrap();
        assert!(Captured::check_folder(&out, true).is_err());
        fs::remove_dir(out.join("frame_98.png")).unwrap();
        let frames = ["frame_00.png", "frame_01.png"].map(PathBuf::from);
        assert_eq!(Captured::frames_in(&out).unwrap(), frames);
    }

    #[test]
    fn frames_without_modulation_name_the_likely_cause() {
        let manifest = Manifest::parse(
            "[projector]\nwidth_px = 64\nheight_px = 48\n\
             [[frame]]\npattern = { kind = \"white\" }\n\
             [[frame]]\npattern = { kind = \"black\" }\n\
             [[frame]]\npattern = { kind = \"fringe\", axis = \"x\", period_px = 16, phase_rad = 0 }\n\
             [[frame]]\npattern = { kind = \"fringe\", axis = \"x\", period_px = 16, phase_rad = 2.0943951 }\n\
             [[frame]]\npattern = { kind = \"fringe\", axis = \"x\", period_px = 16, phase_rad = 4.1887902 }\n",
            "test",
        )
        .unwrap();
        let frame = |id: u64, level: u8| Frame {
            id,
            pattern_index: Some(id as u32),
            width: 64,
            height: 48,
            format: PixelFormat::Grey,
            exposure_start_ns: 0,
            exposure_end_ns: 1,
            data: vec![level; 64 * 48],
        };
        let why = |level: u8| {
            let captured = Captured {
                idn: "a,b,c,d".into(),
                manifest: manifest.clone(),
                calibration: None,
                frames: (0..5).map(|id| frame(id, level)).collect(),
            };
            captured.check_modulation().unwrap_err().to_string()
        };
        assert!(why(255).contains("100 % are saturated"), "{}", why(255));
        assert!(
            why(90).contains("does not see the projector"),
            "{}",
            why(90)
        );
    }
}
