//! Iso-surfaces of volumes, such as a patient's skin in a CT.
//!
//! Marching cubes (Lorensen, Cline 1987) over one bit per voxel; the triangles of each cell case
//! are derived instead of copied from a published table (`table`). Every vertex lies on an edge
//! between two voxels, where trilinear interpolation is linear, so it lies on the interpolated
//! level itself. The mesh is closed (capped at the volume's border) and manifold, and its normals
//! point towards lower values.

mod bits;
mod label;
mod march;
mod table;
#[cfg(test)]
mod tests;

use super::volume::Volume;
use bits::Bits;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::Mesh;

/// Level of a patient's skin in Hounsfield units: half-way between air (-1000) and tissue (about 0
/// to 50), the value of a voxel that the skin cuts in half.
pub const SKIN_HU: f64 = -500.0;

/// Selects the parts of an iso-surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parts {
    /// All parts.
    All,
    /// Only the largest component of face-adjacent voxels: couch, mask and wires are dropped, lungs
    /// remain as cavities whose normals point into them.
    Largest,
    /// Like `Largest`, without its cavities: one closed surface. Air that cannot be reached through
    /// voxel faces from the four sides of the volume counts as inside. The first and last slice are
    /// not entrances: a trachea that they cut does not make the lungs part of the skin.
    LargestFilled,
}

/// Returns the surface where a volume has the value `level`, with greater or equal values inside,
/// in millimetres in the patient frame.
///
/// Vertices lie on the level of the trilinear interpolation, but at least a thousandth of the voxel
/// distance from any voxel's centre, so that no triangle collapses. Caps lie on the outer faces of
/// the volume's voxels, half a voxel beyond the outermost centres. The result does not depend on
/// the number of threads.
///
/// # Errors
/// Returns an error if the level is not finite or no voxel reaches it, or if the volume has more
/// than 2^26 runs of voxels or vertices (noise).
pub fn isosurface(volume: &Volume, level: f64, parts: Parts, place: &str) -> Result<Mesh> {
    if !level.is_finite() {
        return Err(Error::input(
            place,
            format!("a level of {level}"),
            "a number",
        ));
    }
    let mut bits = Bits::of(volume, level);
    if bits.is_empty() {
        let highest = bits::highest(volume);
        return Err(Error::input(
            place,
            format!("no voxel of {level} or more"),
            format!("a level up to {highest}"),
        ));
    }
    if parts != Parts::All {
        label::keep_largest(&mut bits, place)?;
    }
    if parts == Parts::LargestFilled {
        label::fill(&mut bits, place)?;
    }
    march::mesh(volume, level, &bits, place)
}
