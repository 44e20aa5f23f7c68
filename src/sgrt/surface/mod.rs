//! A reference surface made ready for tracking: nearest points with smooth normals, a region of
//! interest, and what the mesh itself is known to.
//!
//! A scan is held against it many times, each time moved by little, so a nearest point is looked for
//! where it was before: from its triangle across edges to the next as long as that is nearer. That
//! ends in the nearest point of the neighbourhood. The first time a grid of triangles says where to
//! start. A hierarchy of boxes (as [`MeshTree`](phasmid_geometry::MeshTree) is) finds the nearest point
//! of all for certain, but takes some ten times as long; what a walk misses lies about as far on the
//! other side of a fold, where both feet are as good as each other.
//!
//! Feet lie on the triangles exactly; normals are interpolated, so that they do not jump at edges. A
//! residual along a smooth normal of a point on a triangle is zero all the same.

mod bend;
mod facet;
mod hints;
mod normals;
mod patches;
mod region;
#[cfg(test)]
mod tests;
mod topology;

pub use region::Region;

use bend::Bend;
use facet::{Facet, Feature, Nearest};
use glam::DVec3;
use hints::Hints;
use patches::Patches;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::Mesh;
use topology::{BORDER, Topology};

/// How far around the mesh the grid of starts reaches, in millimetres: as far as patients are set up
/// wrongly.
const BAND_MM: f64 = 40.0;
/// Steps from triangle to triangle at most: far more than a point can move between two looks.
const STEPS: usize = 64;

/// Where the reference is nearest to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Foot {
    /// The nearest point, in millimetres in the reference's frame.
    pub point: DVec3,
    /// Unit normal of the smooth surface there, outwards.
    pub normal: DVec3,
    /// The triangle, counted among [`Reference::triangles`].
    pub triangle: u32,
    /// Barycentric coordinates of the foot in it.
    pub weights: [f64; 3],
    /// Whether the surface ends there, so that the point may lie beside it, not over it.
    pub border: bool,
}

/// A surface ready for tracking. Coordinates are those of the mesh: for a patient, the room frame
/// with its origin at the isocentre, in millimetres.
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
    /// Makes a checked mesh ready. Triangles that are degenerate are left out.
    ///
    /// # Errors
    /// A region that [`Region::check`] refuses, and one that holds no triangle.
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
                "a region that holds some of the surface",
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
        reference.hints = Hints::new(&reference, lo - BAND_MM, hi + BAND_MM);
        Ok(reference)
    }

    /// The vertices, in the order of the mesh.
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// The triangles that are searched: those of the mesh in its order, without degenerate ones.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Whether a triangle belongs to the region of interest.
    pub fn is_inside(&self, triangle: u32) -> bool {
        self.inside[triangle as usize]
    }

    /// Vertices of the region of interest with their unit normals, outwards.
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

    /// Area of the region of interest in square millimetres.
    pub fn area_mm2(&self) -> f64 {
        self.patches.total_mm2()
    }

    /// Area in square millimetres of those patches (of 20 mm) of the region in which some of these
    /// triangles lie.
    pub fn covered_mm2(&self, triangles: impl Iterator<Item = u32>) -> f64 {
        self.patches.covered_mm2(triangles)
    }

    /// By how much the normals of the region are uncertain, in radians per axis: from the scatter of
    /// the triangles' normals about the smooth ones.
    pub fn normal_sd_rad(&self) -> f64 {
        self.normal_sd_rad
    }

    /// The nearest point to `p`, which is finite.
    #[inline]
    pub fn closest(&self, p: DVec3) -> Foot {
        self.closest_near(p, self.hints.at(p))
    }

    /// The nearest point to `p` in the neighbourhood of a triangle: where it is likely to be, when it
    /// was there for a point that has moved little since.
    #[inline]
    pub fn closest_near(&self, p: DVec3, triangle: u32) -> Foot {
        let (triangle, nearest) = self.walk(p, triangle);
        self.foot(triangle, &nearest)
    }

    /// By how much a point whose error is isotropic with this deviation lies outside of the surface
    /// near a triangle on average, in millimetres: half the deviation's square times the sum of the
    /// principal curvatures.
    #[inline]
    pub fn lift_mm(&self, triangle: u32, sigma_mm: f64) -> f64 {
        self.bends[triangle as usize].isotropic(sigma_mm)
    }

    /// The same for an error along a unit vector.
    #[inline]
    pub fn lift_along_mm(&self, triangle: u32, sigma_mm: f64, along: DVec3) -> f64 {
        self.bends[triangle as usize].along(sigma_mm, along)
    }

    /// Goes from triangle to triangle as long as that brings nearer.
    #[inline]
    fn walk(&self, p: DVec3, start: u32) -> (u32, Nearest) {
        let mut triangle = start;
        let mut nearest = self.facets[start as usize].nearest(p);
        for _ in 0..STEPS {
            let mut next = None;
            let mut offer = |t: u32| {
                let found = self.facets[t as usize].nearest(p);
                // A hair's breadth is rounding, and could lead back and forth.
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
