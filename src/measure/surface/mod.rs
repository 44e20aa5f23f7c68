//! Surfaces for distance queries: a mesh exactly, or a cloud by discs around its points.

mod disc;
mod surfels;
#[cfg(test)]
mod tests;

pub use surfels::Surfels;

use glam::DVec3;
use phasmid_core::error::Result;
use phasmid_geometry::{Cloud, Mesh, MeshTree, ply};
use rayon::prelude::*;
use std::path::Path;

/// The reference surface, as read from a file.
#[derive(Debug, Clone, PartialEq)]
pub enum Truth {
    /// A surface that is known everywhere, in millimetres in the rig's frame.
    Mesh(Mesh),
    /// Points in the rig's frame, all of which are lit and seen.
    Cloud(Cloud),
}

impl Truth {
    /// Reads a `.stl`, `.obj` or `.ply` file; a PLY file without faces is a cloud.
    ///
    /// # Errors
    /// Returns the errors of [`Mesh::read`] and [`ply::read_cloud`].
    pub fn read(path: &Path) -> Result<Self> {
        if path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("ply"))
        {
            return Ok(match ply::read(path)? {
                ply::Ply::Mesh(mesh) => Self::Mesh(mesh),
                ply::Ply::Cloud(cloud) => Self::Cloud(cloud),
            });
        }
        Mesh::read(path).map(Self::Mesh)
    }
}

/// A surface with its search structure.
pub enum Surface {
    /// Triangles.
    Mesh(MeshTree),
    /// Discs around points.
    Cloud(Surfels),
}

/// The point of a surface closest to a query point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Foot {
    /// The closest point of the surface, in millimetres.
    pub point: DVec3,
    /// Distance between the query point and `point`, in millimetres.
    pub distance_mm: f64,
    /// Unit normal at `point`, with the sign given by the file or the winding; zero if there is none.
    pub normal: DVec3,
}

impl Surface {
    /// Builds the search structure.
    ///
    /// # Errors
    /// Returns an error if a cloud has no finite point.
    pub fn new(truth: &Truth) -> Result<Self> {
        Ok(match truth {
            Truth::Mesh(mesh) => Self::Mesh(MeshTree::new(mesh)),
            Truth::Cloud(cloud) => Self::Cloud(Surfels::new(cloud)?),
        })
    }

    /// Returns the closest point of the surface; `None` if `p` is not finite.
    pub fn closest(&self, p: DVec3) -> Option<Foot> {
        match self {
            Self::Mesh(tree) => tree.closest(p).map(|c| Foot {
                point: c.point,
                distance_mm: c.distance_mm,
                normal: c.normal,
            }),
            Self::Cloud(surfels) => surfels.closest(p),
        }
    }

    /// Runs [`Self::closest`] for many points in parallel.
    pub fn closest_batch(&self, points: &[DVec3]) -> Vec<Option<Foot>> {
        points
            .par_iter()
            .with_min_len(256)
            .map(|&p| self.closest(p))
            .collect()
    }
}

pub(super) fn widened(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}
