//! Reads DICOM CT images: a series as a volume, and the series of a 4D-CT as its phases.
//!
//! Supports CT Image Storage (PS3.3 A.3), uncompressed, little endian, with explicit or implicit
//! value representations (PS3.5 A.1, A.2). Implemented here rather than with a crate, because the
//! files may come from anywhere: `dicom-object` 0.10 fills four gigabytes if a file of two hundred
//! bytes claims so, and overflows the stack on nested sequences.

mod element;
mod phases;
mod reference;
mod slice;
mod sorted;
mod stack;
#[cfg(test)]
mod tests;

pub use phases::Phases;
pub use reference::read_reference;

use super::volume::Volume;
use phasmid_core::error::{Error, Result};
use slice::{Slice, slices};
use stack::Stack;
use std::path::Path;

/// Reads the only CT series in a folder and its subfolders, in Hounsfield units. Values below
/// -1024, which scanners use outside their field of view, become -1024.
///
/// # Errors
/// Returns an error, with the file, if a file cannot be read, is not a CT image or is of an
/// unsupported kind; if images differ in series, patient, frame of reference, size, spacing or
/// orientation; or if slices are duplicated, missing, unevenly spaced or not stacked along their
/// normal (a tilted gantry).
pub fn read_series(folder: &Path) -> Result<Volume> {
    let slices = slices(folder)?;
    let first = &slices[0];
    if let Some(other) = slices.iter().find(|slice| slice.series != first.series) {
        return Err(Error::input(
            other.place(),
            format!("series {}", other.title()),
            format!("one series: {} has {}", first.place(), first.title()),
        ));
    }
    Stack::of(slices)?.volume()
}

/// Reads one CT image as a volume of one slice with the thickness stated in the file.
///
/// # Errors
/// Returns an error if the file cannot be read, is not a CT image or is of an unsupported kind.
pub fn read_slice(path: &Path) -> Result<Volume> {
    let (slice, _) = Slice::read(path)?;
    let thickness = slice.thickness_mm.ok_or_else(|| {
        Error::input(
            path.display(),
            "no SliceThickness (0018,0050)",
            "an image with a slice thickness",
        )
    })?;
    Stack::alone(slice, thickness)?.volume()
}
