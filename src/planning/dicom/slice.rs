//! One CT image: its header fields, and its pixels in Hounsfield units. Also collects the images of
//! a folder and its subfolders.

use super::element::{Elements, PIXEL_DATA, Tag};
use glam::DVec3;
use phasmid_core::error::{Error, Result};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Maximum file size of one image.
const MOST_BYTES: u64 = 64 << 20;

/// Lower clamp: smaller values are scanner markers for pixels outside the field of view.
const LEAST_HU: f32 = -1024.0;

const CT_IMAGE: &str = "1.2.840.10008.5.1.4.1.1.2";

/// Names of other DICOM objects often found in such folders.
const OTHERS: [(&str, &str); 9] = [
    ("1.2.840.10008.1.3.10", "a media directory"),
    ("1.2.840.10008.5.1.4.1.1.2.1", "an Enhanced CT Image"),
    ("1.2.840.10008.5.1.4.1.1.4", "an MR Image"),
    ("1.2.840.10008.5.1.4.1.1.7", "a Secondary Capture Image"),
    ("1.2.840.10008.5.1.4.1.1.66.1", "a Spatial Registration"),
    ("1.2.840.10008.5.1.4.1.1.66.4", "a Segmentation"),
    ("1.2.840.10008.5.1.4.1.1.481.2", "an RT Dose"),
    ("1.2.840.10008.5.1.4.1.1.481.3", "an RT Structure Set"),
    ("1.2.840.10008.5.1.4.1.1.481.5", "an RT Plan"),
];

const SOP_CLASS: Tag = (0x0008, 0x0016);
const DESCRIPTION: Tag = (0x0008, 0x103E);
const PATIENT: Tag = (0x0010, 0x0020);
const THICKNESS: Tag = (0x0018, 0x0050);
const TRIGGER_TIME: Tag = (0x0018, 0x1060);
const TILT: Tag = (0x0018, 0x1120);
const SERIES: Tag = (0x0020, 0x000E);
const POSITION: Tag = (0x0020, 0x0032);
const ORIENTATION: Tag = (0x0020, 0x0037);
const FRAME: Tag = (0x0020, 0x0052);
const TEMPORAL: Tag = (0x0020, 0x0100);
const CARDIAC: Tag = (0x0020, 0x9241);
const RESPIRATORY: Tag = (0x0020, 0x9245);
const SAMPLES: Tag = (0x0028, 0x0002);
const FRAMES: Tag = (0x0028, 0x0008);
const ROWS: Tag = (0x0028, 0x0010);
const COLUMNS: Tag = (0x0028, 0x0011);
const SPACING: Tag = (0x0028, 0x0030);
const ALLOCATED: Tag = (0x0028, 0x0100);
const STORED: Tag = (0x0028, 0x0101);
const HIGH_BIT: Tag = (0x0028, 0x0102);
const SIGNED: Tag = (0x0028, 0x0103);
const INTERCEPT: Tag = (0x0028, 0x1052);
const SLOPE: Tag = (0x0028, 0x1053);

const WANTED: [Tag; 25] = [
    SOP_CLASS,
    DESCRIPTION,
    PATIENT,
    THICKNESS,
    TRIGGER_TIME,
    TILT,
    SERIES,
    POSITION,
    ORIENTATION,
    FRAME,
    TEMPORAL,
    CARDIAC,
    RESPIRATORY,
    SAMPLES,
    FRAMES,
    ROWS,
    COLUMNS,
    SPACING,
    ALLOCATED,
    STORED,
    HIGH_BIT,
    SIGNED,
    INTERCEPT,
    SLOPE,
    PIXEL_DATA,
];

/// Header fields of an image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Slice {
    pub(super) path: PathBuf,
    pub(super) patient: String,
    /// Series instance UID.
    pub(super) series: String,
    /// Series description.
    pub(super) description: String,
    /// Frame of reference UID.
    pub(super) frame: String,
    /// Centre of the first pixel (LPS) in millimetres.
    pub(super) position_mm: DVec3,
    /// Directions of increasing column (i) and row (j) index.
    pub(super) along: [DVec3; 2],
    /// Columns and rows.
    pub(super) size: [usize; 2],
    /// Spacing of columns and of rows.
    pub(super) spacing_mm: [f64; 2],
    pub(super) thickness_mm: Option<f64>,
    pub(super) tilt_deg: f64,
    /// Per cent of the cycle, if stated in the image.
    pub(super) percent: Option<f64>,
    pub(super) temporal: Option<f64>,
    pub(super) trigger_ms: Option<f64>,
    bits: u16,
    signed: bool,
    slope: f64,
    intercept: f64,
}

impl Slice {
    /// Reads the header fields of an image.
    pub(super) fn look(path: &Path) -> Result<Self> {
        Self::with(path, |slice, elements| slice.stored(elements).map(|_| ()))
            .map(|(slice, ())| slice)
    }

    /// Reads the header fields and the pixels of an image, in Hounsfield units of at least -1024,
    /// columns fastest.
    pub(super) fn read(path: &Path) -> Result<(Self, Vec<f32>)> {
        Self::with(path, |slice, elements| slice.pixels(elements))
    }

    fn with<T>(
        path: &Path,
        use_it: impl Fn(&Self, &Elements<'_>) -> Result<T>,
    ) -> Result<(Self, T)> {
        let bytes = phasmid_core::file::read(path, MOST_BYTES)?;
        let place = path.display().to_string();
        let elements = Elements::parse(&bytes, &WANTED, &place)?;
        let slice = Self::of(&elements, path)?;
        let made = use_it(&slice, &elements)?;
        Ok((slice, made))
    }

    fn of(e: &Elements<'_>, path: &Path) -> Result<Self> {
        let class = e.text(SOP_CLASS);
        if class != CT_IMAGE {
            let known = OTHERS.iter().find(|(uid, _)| *uid == class);
            let found = known.map_or(format!("class `{class}`"), |(_, name)| (*name).to_owned());
            let allowed = "CT Image Storage; move other objects out of the folder";
            return Err(e.wrong(SOP_CLASS, "SOPClassUID", found, allowed));
        }
        let one = |tag, name: &str, what: f64| match e.numbers::<1>(tag, name)? {
            Some([n]) if n != what => Err(e.wrong(tag, name, n, what)),
            _ => Ok(()),
        };
        one(FRAMES, "NumberOfFrames", 1.0)?;
        let samples = e.short(SAMPLES, "SamplesPerPixel")?;
        if samples != 1 {
            return Err(e.wrong(SAMPLES, "SamplesPerPixel", samples, "1: grey"));
        }
        let size = [
            usize::from(e.short(COLUMNS, "Columns")?),
            usize::from(e.short(ROWS, "Rows")?),
        ];
        let [rows_mm, columns_mm] = e.needed(SPACING, "PixelSpacing")?;
        if rows_mm <= 0.0 || columns_mm <= 0.0 {
            let found = format!("{rows_mm} and {columns_mm} mm");
            return Err(e.wrong(SPACING, "PixelSpacing", found, "distances above 0"));
        }
        let [ix, iy, iz, jx, jy, jz] = e.needed(ORIENTATION, "ImageOrientationPatient")?;
        let along = [DVec3::new(ix, iy, iz), DVec3::new(jx, jy, jz)];
        let unit = |v: DVec3| (v.length() - 1.0).abs() <= 1e-4;
        if !(unit(along[0]) && unit(along[1]) && along[0].dot(along[1]).abs() <= 1e-4) {
            return Err(e.wrong(
                ORIENTATION,
                "ImageOrientationPatient",
                format!("{} and {}", along[0], along[1]),
                "two orthogonal directions of length 1, to within 1e-4",
            ));
        }
        let (bits, signed) = representation(e)?;
        let percent = e.double(RESPIRATORY).or(e.double(CARDIAC));
        let number = |tag, name: &str| Ok::<_, Error>(e.numbers::<1>(tag, name)?.map(|[n]| n));
        let slope = number(SLOPE, "RescaleSlope")?.unwrap_or(1.0);
        let intercept = number(INTERCEPT, "RescaleIntercept")?.unwrap_or(0.0);
        if slope == 0.0 || slope.abs() > 1e6 || intercept.abs() > 1e6 {
            let found = format!("{slope}, with an intercept of {intercept}");
            return Err(e.wrong(SLOPE, "RescaleSlope", found, "numbers within 1e6, not 0"));
        }
        Ok(Self {
            path: path.to_owned(),
            patient: e.text(PATIENT),
            series: e.text(SERIES),
            description: e.text(DESCRIPTION),
            frame: e.text(FRAME),
            position_mm: DVec3::from_array(e.needed(POSITION, "ImagePositionPatient")?),
            along,
            size,
            spacing_mm: [columns_mm, rows_mm],
            thickness_mm: number(THICKNESS, "SliceThickness")?,
            tilt_deg: number(TILT, "GantryDetectorTilt")?.unwrap_or(0.0),
            percent,
            temporal: number(TEMPORAL, "TemporalPositionIdentifier")?,
            trigger_ms: number(TRIGGER_TIME, "TriggerTime")?,
            bits,
            signed,
            slope,
            intercept,
        })
    }

    /// Returns the stored 16-bit words of all pixels; at least one.
    fn stored<'a>(&self, e: &Elements<'a>) -> Result<&'a [[u8; 2]]> {
        let data = e.get(PIXEL_DATA).unwrap_or_default();
        let count = self.size[0] * self.size[1];
        // A value of odd length is padded with a byte; some writers add more.
        if data.len() < 2 * count || count == 0 {
            let [columns, rows] = self.size;
            let allowed = format!("{columns} x {rows} pixels of 2 bytes, at least one");
            let found = format!("{} bytes", data.len());
            return Err(e.wrong(PIXEL_DATA, "PixelData", found, allowed));
        }
        Ok(data[..2 * count].as_chunks::<2>().0)
    }

    /// Converts stored values (PS3.5 8.1.1) by `slope x + intercept` (PS3.3 C.11.1).
    fn pixels(&self, e: &Elements<'_>) -> Result<Vec<f32>> {
        let unused = 16 - u32::from(self.bits);
        let hu = |&word: &[u8; 2]| {
            // The bits above the stored bits may have any value.
            let high = u16::from_le_bytes(word) << unused;
            let stored = if self.signed {
                f64::from(high as i16 >> unused)
            } else {
                f64::from(high >> unused)
            };
            ((self.slope * stored + self.intercept) as f32).max(LEAST_HU)
        };
        Ok(self.stored(e)?.iter().map(hu).collect())
    }

    /// The file's path, for messages.
    pub(super) fn place(&self) -> std::path::Display<'_> {
        self.path.display()
    }

    /// Returns the series' description and UID.
    pub(super) fn title(&self) -> String {
        format!("`{}` ({})", self.description, self.series)
    }
}

/// Returns `(bits, signed)`: the number of bits stored, and whether pixels are signed.
fn representation(e: &Elements<'_>) -> Result<(u16, bool)> {
    let allocated = e.short(ALLOCATED, "BitsAllocated")?;
    if allocated != 16 {
        return Err(e.wrong(
            ALLOCATED,
            "BitsAllocated",
            allocated,
            "16, as CT images have",
        ));
    }
    let bits = e.short(STORED, "BitsStored")?;
    if !(1..=16).contains(&bits) {
        return Err(e.wrong(STORED, "BitsStored", bits, "1 to 16"));
    }
    let high = e.short(HIGH_BIT, "HighBit")?;
    if high != bits - 1 {
        return Err(e.wrong(HIGH_BIT, "HighBit", high, bits - 1));
    }
    match e.short(SIGNED, "PixelRepresentation")? {
        0 => Ok((bits, false)),
        1 => Ok((bits, true)),
        n => Err(e.wrong(
            SIGNED,
            "PixelRepresentation",
            n,
            "0 (unsigned) or 1 (signed)",
        )),
    }
}

/// Maximum number of files; a 4D-CT has about 1500.
const MOST_FILES: usize = 20_000;
/// Maximum folder depth: patient, study, series, and some levels added by programs.
const DEEPEST: usize = 8;

/// Reads the headers of all images, in the order of their paths; at least one image must exist. Hidden
/// files and a `DICOMDIR` are ignored, every other file must be a CT image.
pub(super) fn slices(folder: &Path) -> Result<Vec<Slice>> {
    let mut files = Vec::new();
    collect(folder, 0, &mut files)?;
    files.sort();
    if files.is_empty() {
        return Err(Error::input(folder.display(), "no file", "CT images"));
    }
    let read: Vec<Result<Slice>> = files.par_iter().map(|path| Slice::look(path)).collect();
    // Report the first error in path order, regardless of thread timing.
    read.into_iter().collect()
}

fn collect(folder: &Path, depth: usize, to: &mut Vec<PathBuf>) -> Result<()> {
    let io = |e| Error::io(folder, e);
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let path = entry.map_err(io)?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with('.') || name.eq_ignore_ascii_case("DICOMDIR") {
            continue;
        }
        if !path.is_dir() {
            to.push(path);
        } else if depth < DEEPEST {
            collect(&path, depth + 1, to)?;
        } else {
            let found = format!("more than {DEEPEST} nested folders");
            return Err(Error::input(path.display(), found, "a study's folders"));
        }
        if to.len() > MOST_FILES {
            return Err(Error::input(
                folder.display(),
                format!("more than {MOST_FILES} files"),
                "the images of one patient",
            ));
        }
    }
    Ok(())
}
