//! CT images of DICOM: a series as a volume, and the series of a 4D-CT as its phases.
//!
//! Of the standard's many objects these are CT Image Storage (PS3.3 A.3), uncompressed, little
//! endian, with explicit or implicit value representations (PS3.5 A.1, A.2). Read here rather than
//! by a crate: `dicom-object` 0.10 fills four gigabytes at the word of a file of two hundred bytes,
//! and overflows the stack on nested sequences; these files come from anywhere.

mod element;
mod folder;
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
use slice::Slice;
use stack::Stack;
use std::path::Path;

/// Reads the one CT series in a folder and the folders in it, in Hounsfield units. Numbers below
/// -1024, which scanners put outside of their field of view, become -1024.
///
/// # Errors
/// What the system refuses; each with its file: what is no CT image, or of a kind that is not
/// read; images of several series, patients, frames of reference, sizes, spacings or orientations;
/// doubled and missing slices, uneven distances, slices that do not lie above each other (a
/// tilted gantry).
pub fn read_series(folder: &Path) -> Result<Volume> {
    let slices = folder::slices(folder)?;
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

/// Reads one CT image as a volume of one slice, as thick as it says.
///
/// # Errors
/// What the system refuses, and what is no CT image or of a kind that is not read.
pub fn read_slice(path: &Path) -> Result<Volume> {
    let (slice, _) = Slice::read(path)?;
    let thickness = slice.thickness_mm.ok_or_else(|| {
        Error::input(
            path.display(),
            "no SliceThickness (0018,0050)",
            "an image that says how thick its slice is",
        )
    })?;
    Stack::alone(slice, thickness)?.volume()
}
