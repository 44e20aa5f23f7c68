//! Checks that the files of a planning fit each other.

use crate::metaimage;
use crate::volume::{Field, Grid, listed};
use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::Mesh;
use std::collections::HashSet;
use std::path::Path;

/// Maximum displacement in the field from the reference phase to itself: the residual of
/// registering an image with itself.
const STILL_MM: f64 = 0.5;

/// Maximum total size of the fields in bytes. Ten fields of 512 x 512 x 100 voxels take three quarters
/// of this size; a 3 mm grid is sufficient.
const MOST_BYTES: u64 = 4 << 30;

/// Volume that a surface encloses, and the centroid of this volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moments {
    /// Volume in cubic millimetres.
    pub(crate) volume_mm3: f64,
    /// Centroid in the surface's frame.
    pub centroid_mm: DVec3,
}

/// Reads the grid of a file, which must have `channels` values per voxel: 1 for a CT, 3 for a
/// field.
pub(crate) fn grid_of(path: &Path, channels: usize) -> Result<Grid> {
    let (grid, found) = metaimage::read_grid(path)?;
    if found == channels {
        return Ok(grid);
    }
    let allowed = [
        "one number per voxel: a CT",
        "three numbers per voxel: a displacement field",
    ][usize::from(channels == 3)];
    Err(Error::input(
        path.display(),
        metaimage::channels(found),
        allowed,
    ))
}

/// Rejects fields that do not fit in memory together.
pub(crate) fn in_memory(grid: &Grid, fields: usize, place: &str) -> Result<()> {
    let bytes = 12 * grid.voxels() as u64 * fields as u64;
    if bytes <= MOST_BYTES {
        return Ok(());
    }
    Err(Error::input(
        place,
        format!("{fields} fields of {bytes} bytes in all"),
        format!("up to {MOST_BYTES}: fields on a coarser grid"),
    ))
}

/// Rejects a CT that is rotated against the fields, or does not enclose them to within one voxel of the
/// fields.
pub(crate) fn around(ct: &Grid, fields: &Grid, place: &str) -> Result<()> {
    for axis in 0..3 {
        let (a, b) = (ct.direction.col(axis), fields.direction.col(axis));
        if (a - b).length() > 1e-3 {
            let found = format!("axis {axis} along {}", listed(a));
            let allowed = format!("as the fields have it: {}", listed(b));
            return Err(Error::input(place, found, allowed));
        }
    }
    let reach = 0.5 + fields.spacing_mm / ct.spacing_mm;
    let [low, high] = [DVec3::ZERO, fields.last()].map(|end| ct.index(fields.point(end)));
    if low.cmpge(-reach).all() && high.cmple(ct.last() + reach).all() {
        return Ok(());
    }
    let found = format!("a CT that spans {}", ct.box_in_words());
    let allowed = format!(
        "a CT that contains the fields, which span {}",
        fields.box_in_words()
    );
    Err(Error::input(place, found, allowed))
}

/// Rejects a mesh that extends beyond the fields.
pub(crate) fn within(mesh: &Mesh, fields: &Grid, place: &str) -> Result<()> {
    let outside = |v: &&DVec3| !fields.holds(fields.index(**v));
    let count = mesh.vertices.iter().filter(outside).count();
    let Some(first) = mesh.vertices.iter().find(outside) else {
        return Ok(());
    };
    let all = mesh.vertices.len();
    Err(Error::input(
        place,
        format!(
            "{count} of {all} vertices outside of the fields, {} first",
            listed(*first)
        ),
        format!("vertices within {}", fields.box_in_words()),
    ))
}

/// Rejects a field from the reference phase to itself that is not zero.
pub(crate) fn still(field: &Field, place: &str) -> Result<()> {
    let longest = field.longest_mm();
    if longest <= STILL_MM {
        return Ok(());
    }
    let found = format!("displacements of up to {longest:.2} mm");
    let allowed = format!("at most {STILL_MM} mm from the reference phase to itself");
    Err(Error::input(place, found, allowed))
}

/// Returns the moments of a closed surface; rejects any other surface.
pub fn closed(mesh: &Mesh, place: &str) -> Result<Moments> {
    let mut sides = HashSet::with_capacity(3 * mesh.triangles.len());
    for &[a, b, c] in &mesh.triangles {
        for side in [(a, b), (b, c), (c, a)] {
            if !sides.insert(side) {
                let found = format!(
                    "two triangles with the same directed edge of vertices {} and {}",
                    side.0, side.1
                );
                return Err(Error::input(
                    place,
                    found,
                    "a closed surface, each edge shared by two triangles",
                ));
            }
        }
    }
    if let Some((a, b)) = mesh
        .triangles
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
        .find(|&(a, b)| !sides.contains(&(b, a)))
    {
        let found = format!("an open edge between vertices {a} and {b}");
        return Err(Error::input(
            place,
            found,
            "a closed surface, each edge shared by two triangles",
        ));
    }
    let moments = moments(mesh);
    if moments.volume_mm3 > 0.0 {
        return Ok(moments);
    }
    let found = format!("a volume of {} mm^3", moments.volume_mm3);
    Err(Error::input(
        place,
        found,
        "a surface whose normals point outwards",
    ))
}

/// Moments by tetrahedra from a point of the surface, so that a distant origin costs no precision.
fn moments(mesh: &Mesh) -> Moments {
    let from = mesh.vertices.first().copied().unwrap_or_default();
    let (mut volume, mut moment) = (0.0, DVec3::ZERO);
    for triangle in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(triangle).map(|v| v - from);
        let part = a.dot(b.cross(c)) / 6.0;
        volume += part;
        moment += (a + b + c) * (part / 4.0);
    }
    Moments {
        volume_mm3: volume,
        centroid_mm: from + moment / volume,
    }
}
