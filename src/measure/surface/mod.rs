//! Surfaces that a distance can be measured to: a mesh exactly, a cloud by the discs that it is
//! taken to sample.

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

/// What a cloud is held against, as a file gave it.
#[derive(Debug, Clone, PartialEq)]
pub enum Truth {
    /// A surface known everywhere, in millimetres in the rig's frame.
    Mesh(Mesh),
    /// Points that are all lit and seen, in the rig's frame.
    Cloud(Cloud),
}

impl Truth {
    /// Reads `.stl`, `.obj` or `.ply`; a PLY file without faces is a cloud.
    ///
    /// # Errors
    /// As [`Mesh::read`] and [`ply::read_cloud`].
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

/// A surface ready for queries.
pub enum Surface {
    /// Triangles.
    Mesh(MeshTree),
    /// Discs around points.
    Cloud(Surfels),
}

/// Where a surface is nearest to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Foot {
    /// The nearest point of the surface, in millimetres.
    pub point: DVec3,
    /// Distance to it in millimetres.
    pub distance_mm: f64,
    /// Unit normal there, its sign as the file or the winding has it; zero where there is none.
    pub normal: DVec3,
}

impl Surface {
    /// Makes a truth ready for queries.
    ///
    /// # Errors
    /// A cloud without a finite point.
    pub fn new(truth: &Truth) -> Result<Self> {
        Ok(match truth {
            Truth::Mesh(mesh) => Self::Mesh(MeshTree::new(mesh)),
            Truth::Cloud(cloud) => Self::Cloud(Surfels::new(cloud)?),
        })
    }

    /// The nearest point of the surface; `None` for a `p` that is not finite.
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

    /// [`Self::closest`] of many points, over all cores.
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
