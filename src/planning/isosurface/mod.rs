//! The surface where a volume passes through a level: a patient's skin in a CT.
//!
//! Marching cubes (Lorensen, Cline 1987) over one bit a voxel, with the cells' triangles not copied
//! from a table of somebody's but derived (`table`). Every vertex stands on an edge between
//! two voxels, where trilinear interpolation is linear, so that it lies on the interpolated level
//! itself. The mesh is closed (what the volume's border cuts is capped there), manifold, and its
//! normals point to the lower numbers.

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

/// Level of a patient's skin in Hounsfield units: midway between air (-1000) and tissue (about 0 to
/// 50), where a voxel stands that the skin cuts in half.
pub const SKIN_HU: f64 = -500.0;

/// Which parts of a level's surface are wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parts {
    /// All of them.
    All,
    /// Those of the largest body (voxels that touch by their faces, the most of them): couch, mask
    /// and wires go, lungs stay as cavities whose normals point into them.
    Largest,
    /// As `Largest`, without its cavities: one closed surface. Air that cannot be reached from the
    /// four sides of the volume, passing voxels' faces, counts as inside. Its first and last slice
    /// are no way in: a windpipe that they cut does not make the lungs a part of the skin.
    LargestFilled,
}

/// The surface on which a volume has the number `level`, with what is greater or equal inside, in
/// millimetres in the patient frame.
///
/// Vertices lie on the level of the trilinear interpolation; where that would put one within a
/// thousandth of a voxel's distance of a voxel's centre, it is moved to that distance, so that no
/// triangle collapses. Caps lie on the outer faces of the volume's voxels, half a voxel beyond the
/// outermost centres. The result does not depend on the number of threads.
///
/// # Errors
/// A level that no voxel reaches, or not finite; a volume of noise rather than bodies: more than
/// 2^26 runs of voxels or vertices.
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

/// A volume with more of anything than anyone could use.
fn ragged(found: String, place: &str) -> Error {
    Error::input(
        place,
        found,
        "a level and a volume that make bodies, not noise: smooth it, or take another level",
    )
}
