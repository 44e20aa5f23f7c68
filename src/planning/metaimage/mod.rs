//! MetaImage (`.mha`, or `.mhd` with `.raw` or `.zraw`): volumes and displacement fields as written
//! by ITK, elastix and plastimatch.
//!
//! The format is that of MetaIO (<https://itk.org/Wiki/MetaIO/Documentation>); where the text is
//! ambiguous, ITK's reader decides: `TransformMatrix` lists the directions of i, j and k in this
//! order; coordinates are LPS; `CenterOfRotation` has no effect.

mod data;
mod element;
mod header;
mod lines;
#[cfg(test)]
mod tests;
mod write;

pub use write::{
    Packing, write_field, write_field_by_planes, write_volume, write_volume_by_planes,
};

use super::volume::{Field, Grid, Volume, Voxels};
use data::Data;
use element::Element;
use header::Header;
use phasmid_core::error::{Error, Result};
use std::path::Path;

/// Reads a volume of one value per voxel. Integers of up to 16 bits that fit an `i16` are kept as
/// such; all other types become `f32`, rounded if they have more than 24 bits.
///
/// # Errors
/// Returns an error if the file cannot be read, is malformed or truncated, uses an unsupported
/// feature, or has more than 2^28 values or one that is not finite.
pub fn read_volume(path: &Path) -> Result<Volume> {
    let header = Header::read(path)?;
    header.has_channels(1, "one number per voxel: a volume, not a vector field")?;
    let data = Data::open(&header)?;
    let count = header.grid.voxels();
    let mut voxels = match header.element {
        Element::I8 | Element::U8 | Element::I16 => Voxels::I16(Vec::with_capacity(count)),
        _ => Voxels::F32(Vec::with_capacity(count)),
    };
    data.read(|bytes| match &mut voxels {
        Voxels::I16(v) => header.element.append_i16(bytes, header.big_endian, v),
        Voxels::F32(v) => header.element.append_f32(bytes, header.big_endian, v),
    })?;
    Volume::new(header.grid, voxels, &header.place)
}

/// Reads a field of three values per voxel, displacements in millimetres, as `f32`.
///
/// # Errors
/// Returns the errors of [`read_volume`], and an error if a displacement is not finite or longer
/// than 500 mm.
pub fn read_field(path: &Path) -> Result<Field> {
    let header = Header::read(path)?;
    header.has_channels(3, "ElementNumberOfChannels = 3: a displacement field")?;
    let data = Data::open(&header)?;
    let mut vectors = Vec::with_capacity(header.grid.voxels());
    let mut numbers = Vec::new();
    data.read(|bytes| {
        numbers.clear();
        header
            .element
            .append_f32(bytes, header.big_endian, &mut numbers);
        let (whole, _) = numbers.as_chunks::<3>();
        vectors.extend_from_slice(whole);
    })?;
    Field::new(header.grid, vectors, &header.place)
}

/// Reads only the grid of a file and its number of values per voxel.
///
/// # Errors
/// Returns an error if the header cannot be read or is malformed.
pub fn read_grid(path: &Path) -> Result<(Grid, usize)> {
    let header = Header::read(path)?;
    Ok((header.grid, header.channels))
}

impl Header {
    fn has_channels(&self, wanted: usize, allowed: &str) -> Result<()> {
        if self.channels == wanted {
            return Ok(());
        }
        Err(Error::input(&self.place, channels(self.channels), allowed))
    }
}

/// Number of values per voxel, for messages.
pub(super) fn channels(count: usize) -> String {
    match count {
        1 => "1 number per voxel".to_owned(),
        n => format!("{n} numbers per voxel"),
    }
}
