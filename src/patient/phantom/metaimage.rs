//! Fields and CTs as MetaImage, plane by plane, so that no volume has to be held: the little that the
//! export needs.

use crate::error::Result;
use crate::geometry::file::write_whole;
use glam::DVec3;
use std::io::Write;
use std::path::Path;

/// A lattice along the patient's axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lattice {
    /// Voxels along x, y and z.
    pub(super) size: [usize; 3],
    pub(super) spacing_mm: f64,
    /// Middle of the first voxel.
    pub(super) origin_mm: DVec3,
}

impl Lattice {
    /// The middle of a voxel.
    pub(super) fn point(&self, index: [usize; 3]) -> DVec3 {
        self.origin_mm + self.spacing_mm * DVec3::from_array(index.map(|i| i as f64))
    }
}

/// Writes a field of three floats a voxel; `plane` gives the bytes of each plane of one z, x running
/// fastest, little endian.
///
/// # Errors
/// What the system refuses.
pub(super) fn write_vectors(
    path: &Path,
    lattice: &Lattice,
    plane: impl Fn(usize) -> Vec<u8>,
) -> Result<()> {
    write(path, lattice, 3, "MET_FLOAT", plane)
}

/// The same of one signed 16-bit integer a voxel.
///
/// # Errors
/// What the system refuses.
pub(super) fn write_shorts(
    path: &Path,
    lattice: &Lattice,
    plane: impl Fn(usize) -> Vec<u8>,
) -> Result<()> {
    write(path, lattice, 1, "MET_SHORT", plane)
}

fn write(
    path: &Path,
    lattice: &Lattice,
    channels: usize,
    kind: &str,
    plane: impl Fn(usize) -> Vec<u8>,
) -> Result<()> {
    let ([nx, ny, nz], s, o) = (lattice.size, lattice.spacing_mm, lattice.origin_mm);
    write_whole(path, |out| {
        writeln!(out, "ObjectType = Image\nNDims = 3")?;
        writeln!(out, "BinaryData = True\nBinaryDataByteOrderMSB = False")?;
        writeln!(out, "CompressedData = False")?;
        writeln!(out, "TransformMatrix = 1 0 0 0 1 0 0 0 1")?;
        writeln!(out, "Offset = {} {} {}", o.x, o.y, o.z)?;
        writeln!(out, "CenterOfRotation = 0 0 0\nAnatomicalOrientation = RAI")?;
        writeln!(
            out,
            "ElementSpacing = {s} {s} {s}\nDimSize = {nx} {ny} {nz}"
        )?;
        if channels > 1 {
            writeln!(out, "ElementNumberOfChannels = {channels}")?;
        }
        writeln!(out, "ElementType = {kind}\nElementDataFile = LOCAL")?;
        (0..nz).try_for_each(|k| out.write_all(&plane(k)))
    })
}
