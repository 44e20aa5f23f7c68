//! The reference surface of tracking: closest points with smooth normals, a region of interest, and
//! the mesh's own accuracy.
//!
//! A scan is compared with the surface many times, each time after a small motion, so the search for a
//! closest point starts at the previous triangle and walks across edges and corners as long as the
//! distance decreases. It ends at the closest point of the neighbourhood. The first search starts from
//! a grid of triangles. A hierarchy of boxes (see [`MeshTree`](phasmid_geometry::MeshTree)) guarantees
//! the global closest point but takes about ten times as long; where a walk misses that point, it is
//! about as far away on the other side of a fold, and both feet are equally plausible.
//!
//! A foot (the closest point) lies exactly on its triangle. Normals are interpolated, so they do not
//! jump at edges; the residual of a point on a triangle is still zero along a smooth normal.
//!
//! | file | content |
//! | --- | --- |
//! | `facet` | closest point of one triangle |
//! | `hints` | the grid of start triangles |
//! | `topology` | adjacency of triangles |
//! | `normals` | vertex normals and their uncertainty; curvature, and the bias that noise causes |
//! | `region` | the region of interest and its coverage |

mod facet;
mod hints;
mod normals;
mod region;
#[cfg(test)]
mod tests;
mod topology;

pub use region::Region;

use facet::{Facet, Feature, Nearest};
use glam::DVec3;
use hints::Hints;
use normals::Bend;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::Mesh;
use region::Patches;
use topology::{BORDER, Topology};

/// Margin of the grid of start triangles around the mesh, in millimetres: the largest set-up error of
/// a patient.
const BAND_MM: f64 = 40.0;
/// Maximum number of steps from triangle to triangle: far more than a point moves between two
/// searches.
const STEPS: usize = 64;

/// The closest point of the reference to a given point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Foot {
    /// Closest point, in millimetres in the reference's frame.
    pub point: DVec3,
    /// Outward unit normal of the smooth surface at the foot.
    pub normal: DVec3,
    /// Index into [`Reference::triangles`].
    pub triangle: u32,
    /// Barycentric coordinates of the foot in the triangle.
    pub weights: [f64; 3],
    /// Whether the foot lies on a border of the surface, so that the point may lie beside the surface
    /// instead of over it.
    pub border: bool,
}

/// A surface prepared for tracking, in the mesh's frame: for a patient, the room frame with its
/// origin at the isocentre, in millimetres.
pub struct Reference {
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    facets: Vec<Facet>,
    inside: Vec<bool>,
    topology: Topology,
    bends: Vec<Bend>,
    hints: Hints,
    patches: Patches,
    normal_sd_rad: f64,
}

impl Reference {
    /// Prepares a valid mesh. Degenerate triangles are omitted.
    ///
    /// # Errors
    /// Returns an error if [`Region::check`] rejects the region, or if the region contains no
    /// triangle.
    pub fn new(mesh: &Mesh, region: &Region) -> Result<Self> {
        region.check(mesh.vertices.len())?;
        let vertices = mesh.vertices.clone();
        let triangles: Vec<[u32; 3]> = mesh
            .triangles
            .iter()
            .copied()
            .filter(|t| {
                let [a, b, c] = t.map(|i| vertices[i as usize]);
                let doubled = (b - a).cross(c - a).length();
                doubled > 1e-9 * (b - a).length() * (c - a).length()
            })
            .collect();
        let normals = normals::vertex_normals(&vertices, &triangles);
        let mask = region.mask(&vertices, &normals);
        let inside: Vec<bool> = triangles
            .iter()
            .map(|t| t.iter().all(|&i| mask[i as usize]))
            .collect();
        let chosen = || triangles.iter().zip(&inside).filter(|(_, i)| **i);
        if chosen().next().is_none() {
            return Err(Error::input(
                "region",
                "no triangle of the reference surface",
                "a region that contains part of the surface",
            ));
        }
        let facets: Vec<Facet> = triangles
            .iter()
            .map(|t| Facet {
                corners: t.map(|i| vertices[i as usize]),
                normals: t.map(|i| normals[i as usize].as_vec3()),
            })
            .collect();
        let (lo, hi) = mesh.bounds().unwrap_or_default();
        let mut reference = Self {
            normal_sd_rad: normals::deviation_rad(&vertices, chosen().map(|(t, _)| *t), &normals),
            topology: Topology::new(vertices.len(), &triangles),
            bends: facets.iter().map(Bend::of).collect(),
            patches: Patches::new(&facets, &inside),
            hints: Hints::none(),
            vertices,
            triangles,
            facets,
            inside,
        };
        let walk = |p, triangle| reference.walk(p, triangle).0;
        reference.hints = Hints::new(&reference.facets, walk, lo - BAND_MM, hi + BAND_MM);
        Ok(reference)
    }

    /// Returns the vertices, in the order of the mesh.
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// Returns the triangles that are searched: all of the mesh, in its order, except degenerate
    /// ones.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Returns whether a triangle belongs to the region of interest.
    pub fn is_inside(&self, triangle: u32) -> bool {
        self.inside[triangle as usize]
    }

    /// Returns the vertices of the region of interest with their outward unit normals.
    pub fn region_normals(&self) -> Vec<(u32, DVec3)> {
        let mut normals = vec![None; self.vertices.len()];
        for ((t, facet), inside) in self.triangles.iter().zip(&self.facets).zip(&self.inside) {
            if *inside {
                for k in 0..3 {
                    normals[t[k] as usize] = Some(facet.normals[k].as_dvec3());
                }
            }
        }
        let known = normals.into_iter().zip(0..);
        known.filter_map(|(n, v)| n.map(|n| (v, n))).collect()
    }

    /// Returns the area of the region of interest in square millimetres.
    pub fn area_mm2(&self) -> f64 {
        self.patches.total_mm2()
    }

    /// Computes the area, in square millimetres, of the region's patches (20 mm wide) that contain
    /// any of these triangles.
    pub fn covered_mm2(&self, triangles: impl Iterator<Item = u32>) -> f64 {
        self.patches.covered_mm2(triangles)
    }

    /// Returns the standard deviation of the region's normals in radians per axis, estimated from the
    /// scatter of the triangles' normals about the smooth normals.
    pub fn normal_sd_rad(&self) -> f64 {
        self.normal_sd_rad
    }

    /// Finds the closest point to `p`, which must be finite.
    #[inline]
    pub fn closest(&self, p: DVec3) -> Foot {
        self.closest_near(p, self.hints.at(p))
    }

    /// Finds the closest point to `p` by a walk from a triangle. For a point that has moved little,
    /// start at the triangle of its previous foot.
    #[inline]
    pub fn closest_near(&self, p: DVec3, triangle: u32) -> Foot {
        let (triangle, nearest) = self.walk(p, triangle);
        self.foot(triangle, &nearest)
    }

    /// Computes the mean distance, in millimetres, by which isotropic noise shifts points outwards
    /// near a triangle: half the noise variance times the sum of the principal curvatures.
    #[inline]
    pub fn lift_mm(&self, triangle: u32, sigma_mm: f64) -> f64 {
        self.bends[triangle as usize].isotropic(sigma_mm)
    }

    /// Like [`Self::lift_mm`], for noise along a unit vector.
    #[inline]
    pub fn lift_along_mm(&self, triangle: u32, sigma_mm: f64, along: DVec3) -> f64 {
        self.bends[triangle as usize].along(sigma_mm, along)
    }

    /// Walks from triangle to triangle as long as the distance decreases.
    #[inline]
    fn walk(&self, p: DVec3, start: u32) -> (u32, Nearest) {
        let mut triangle = start;
        let mut nearest = self.facets[start as usize].nearest(p);
        for _ in 0..STEPS {
            let mut next = None;
            let mut offer = |t: u32| {
                let found = self.facets[t as usize].nearest(p);
                // Ignore improvements at the rounding level: they could cause endless alternation.
                let least = next.map_or(nearest.distance_squared, |(_, n): (u32, Nearest)| {
                    n.distance_squared
                });
                if found.distance_squared < least * (1.0 - 1e-12) {
                    next = Some((t, found));
                }
            };
            match nearest.feature {
                Feature::Inside => {}
                Feature::Edge(k) => {
                    let over = self.topology.across[triangle as usize][k];
                    if over != BORDER {
                        offer(over);
                    }
                }
                Feature::Corner(k) => {
                    let vertex = self.triangles[triangle as usize][k];
                    for &t in self.topology.ring(vertex) {
                        if t != triangle {
                            offer(t);
                        }
                    }
                }
            }
            match next {
                Some((t, found)) => (triangle, nearest) = (t, found),
                None => break,
            }
        }
        (triangle, nearest)
    }

    #[inline]
    fn foot(&self, triangle: u32, nearest: &Nearest) -> Foot {
        let border = match nearest.feature {
            Feature::Inside => false,
            Feature::Edge(k) => self.topology.across[triangle as usize][k] == BORDER,
            Feature::Corner(k) => {
                self.topology.on_border[self.triangles[triangle as usize][k] as usize]
            }
        };
        Foot {
            point: nearest.point,
            normal: self.facets[triangle as usize].normal(nearest.weights),
            triangle,
            weights: nearest.weights,
            border,
        }
    }
}
