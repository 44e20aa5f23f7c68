//! The part of a reference surface that is tracked, and its division into patches, which measure how
//! much of it a scan covers.

use super::Facet;
use glam::{DVec2, DVec3};
use phasmid_core::error::{Error, Result};
use std::collections::HashMap;

/// A region of interest, in the reference surface's frame: the room frame with its origin at the
/// isocentre, in millimetres.
#[derive(Debug, Clone, PartialEq)]
pub enum Region {
    /// The whole surface.
    All,
    /// Inside an axis-aligned box.
    Box {
        /// Lowest corner.
        lo: DVec3,
        /// Highest corner.
        hi: DVec3,
    },
    /// Inside a sphere.
    Sphere {
        /// Centre, in millimetres.
        centre: DVec3,
        /// Radius in millimetres.
        radius_mm: f64,
    },
    /// Above a simple polygon on the couch (x, y; either winding), where the surface faces up:
    /// excludes the back of a closed body.
    Polygon(Vec<DVec2>),
    /// These vertices of the mesh, counted from 0, for example as painted by a user.
    Vertices(Vec<u32>),
}

impl Region {
    /// Checks that the numbers describe a region; `count` is the mesh's number of vertices.
    ///
    /// # Errors
    /// Returns an error that names the first invalid value.
    pub fn check(&self, count: usize) -> Result<()> {
        let bad = |found: String, allowed: &str| Err(Error::input("region", found, allowed));
        match self {
            Self::All => Ok(()),
            Self::Box { lo, hi } => {
                if lo.is_finite() && hi.is_finite() && lo.cmplt(*hi).all() {
                    return Ok(());
                }
                bad(
                    format!("a box from {lo} to {hi}"),
                    "lo below hi on every axis",
                )
            }
            Self::Sphere { centre, radius_mm } => {
                if centre.is_finite() && radius_mm.is_finite() && *radius_mm > 0.0 {
                    return Ok(());
                }
                bad(
                    format!("a sphere of {radius_mm} mm about {centre}"),
                    "a positive radius about a finite centre",
                )
            }
            Self::Polygon(corners) => {
                if corners.len() >= 3 && corners.iter().all(|c| c.is_finite()) {
                    return Ok(());
                }
                bad(
                    format!("a polygon of {} corners", corners.len()),
                    "three finite corners or more",
                )
            }
            Self::Vertices(vertices) => match vertices.iter().find(|&&v| v as usize >= count) {
                None => Ok(()),
                Some(v) => bad(
                    format!("vertex {v}"),
                    &format!("vertices 0 to {}", count as i64 - 1),
                ),
            },
        }
    }

    /// Mask of the vertices in the region, from their positions and outward normals.
    pub(super) fn mask(&self, vertices: &[DVec3], normals: &[DVec3]) -> Vec<bool> {
        if let Self::Vertices(listed) = self {
            let mut mask = vec![false; vertices.len()];
            for &v in listed {
                mask[v as usize] = true;
            }
            return mask;
        }
        let holds = |p: &DVec3, n: &DVec3| match self {
            Self::All | Self::Vertices(_) => true,
            Self::Box { lo, hi } => p.cmpge(*lo).all() && p.cmple(*hi).all(),
            Self::Sphere { centre, radius_mm } => (*p - *centre).length() <= *radius_mm,
            Self::Polygon(corners) => n.z > 0.0 && encloses(corners, p.truncate()),
        };
        vertices
            .iter()
            .zip(normals)
            .map(|(p, n)| holds(p, n))
            .collect()
    }
}

/// Whether a polygon encloses a point, by counting the edges to its right.
fn encloses(corners: &[DVec2], p: DVec2) -> bool {
    let mut inside = false;
    let mut from = corners[corners.len() - 1];
    for &to in corners {
        if (from.y > p.y) != (to.y > p.y) {
            let x = from.x + (to.x - from.x) * (p.y - from.y) / (to.y - from.y);
            inside ^= p.x < x;
        }
        from = to;
    }
    inside
}

/// Edge of a patch in millimetres: coarser than the spacing of points (a few lie in each), finer than
/// objects that occlude a patient.
const PATCH_MM: f64 = 20.0;

/// Patches of the region of interest.
pub(super) struct Patches {
    /// Patch of each triangle; `u32::MAX` outside the region.
    of: Vec<u32>,
    area_mm2: Vec<f64>,
}

impl Patches {
    pub(super) fn new(facets: &[Facet], inside: &[bool]) -> Self {
        let mut numbers: HashMap<[i64; 3], u32> = HashMap::new();
        let mut area_mm2: Vec<f64> = Vec::new();
        let of = facets
            .iter()
            .zip(inside)
            .map(|(facet, &inside)| {
                if !inside {
                    return u32::MAX;
                }
                let [a, b, c] = facet.corners;
                let cell = ((a + b + c) / (3.0 * PATCH_MM)).floor();
                let key = cell.to_array().map(|x| x as i64);
                let next = numbers.len() as u32;
                let number = *numbers.entry(key).or_insert(next);
                area_mm2.resize(numbers.len(), 0.0);
                area_mm2[number as usize] += (b - a).cross(c - a).length() / 2.0;
                number
            })
            .collect();
        Self { of, area_mm2 }
    }

    pub(super) fn total_mm2(&self) -> f64 {
        self.area_mm2.iter().sum()
    }

    /// Area in square millimetres of the patches that contain these triangles.
    pub(super) fn covered_mm2(&self, triangles: impl Iterator<Item = u32>) -> f64 {
        let mut seen = vec![false; self.area_mm2.len()];
        for t in triangles {
            if let Some(seen) = seen.get_mut(self.of[t as usize] as usize) {
                *seen = true;
            }
        }
        let areas = self.area_mm2.iter().zip(seen);
        areas.filter(|(_, seen)| *seen).map(|(a, _)| a).sum()
    }
}
