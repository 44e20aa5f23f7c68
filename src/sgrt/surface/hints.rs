//! A grid of start triangles for the search.
//!
//! Cells that contain triangle centres store the closest of these triangles. Other cells take a triangle
//! from a neighbouring cell in sweeps over the grid in all eight diagonal directions (H. Zhao, "A fast
//! sweeping method for Eikonal equations", 2005; P. Danielsson, "Euclidean distance mapping", 1980).
//! Finally a walk from each cell's triangle finds the triangle closest to the cell's centre.

use super::facet::Facet;
use glam::{DVec3, IVec3, UVec3};
use rayon::prelude::*;

/// Maximum number of cells, so that building the grid takes a few tenths of a second and one
/// megabyte.
const MOST: f64 = 250_000.0;
/// Minimum cell size in millimetres: about the edge length of a triangle.
const FINEST_MM: f64 = 4.0;
/// A cell without a triangle yet.
const NONE: u32 = u32::MAX;

/// A triangle near the centre of each cell of a box.
pub(super) struct Hints {
    lo: DVec3,
    per_mm: f64,
    size: UVec3,
    triangles: Vec<u32>,
}

impl Hints {
    pub(super) fn none() -> Self {
        Self {
            lo: DVec3::ZERO,
            per_mm: 1.0,
            size: UVec3::ONE,
            triangles: vec![0],
        }
    }

    /// Builds the grid over a box around the surface; the box must not be flat. Starting at a triangle,
    /// `walk` finds the triangle closest to a point.
    pub(super) fn new(
        facets: &[Facet],
        walk: impl Fn(DVec3, u32) -> u32 + Sync,
        lo: DVec3,
        hi: DVec3,
    ) -> Self {
        let sides = hi - lo;
        let cell = FINEST_MM.max((sides.element_product() / MOST).cbrt());
        let size = (sides / cell).ceil().max(DVec3::ONE).as_uvec3();
        let mut hints = Self {
            lo,
            per_mm: 1.0 / cell,
            size,
            triangles: vec![NONE; (size.x * size.y * size.z) as usize],
        };
        let mut distances = vec![f64::INFINITY; hints.triangles.len()];
        for (i, facet) in facets.iter().enumerate() {
            let [a, b, c] = facet.corners;
            let at = hints.cell((a + b + c) / 3.0);
            let index = hints.index(at);
            let found = facet.nearest(hints.centre(at)).distance_squared;
            if found < distances[index] {
                (hints.triangles[index], distances[index]) = (i as u32, found);
            }
        }
        for sweep in 0..8 {
            hints.sweep(facets, &mut distances, sweep);
        }
        let mut triangles = std::mem::take(&mut hints.triangles);
        let row = size.x as usize;
        triangles
            .par_chunks_mut(row)
            .enumerate()
            .for_each(|(k, row)| {
                let (y, z) = (k as u32 % size.y, k as u32 / size.y);
                for (x, triangle) in row.iter_mut().enumerate() {
                    let centre = hints.centre(UVec3::new(x as u32, y, z));
                    *triangle = walk(centre, *triangle);
                }
            });
        hints.triangles = triangles;
        hints
    }

    /// One pass over all cells, forwards or backwards along each axis by the bits of `direction`.
    fn sweep(&mut self, facets: &[Facet], distances: &mut [f64], direction: u32) {
        let size = self.size.as_ivec3();
        let against = [1, 2, 4].map(|bit| direction & bit != 0);
        let along = |k: i32, axis: usize| match against[axis] {
            true => size[axis] - 1 - k,
            false => k,
        };
        for z in 0..size.z {
            for y in 0..size.y {
                for x in 0..size.x {
                    let at = IVec3::new(along(x, 0), along(y, 1), along(z, 2));
                    let index = self.index(at.as_uvec3());
                    let centre = self.centre(at.as_uvec3());
                    for axis in 0..3 {
                        let mut before = at;
                        before[axis] += if against[axis] { 1 } else { -1 };
                        if before[axis] < 0 || before[axis] >= size[axis] {
                            continue;
                        }
                        let known = self.triangles[self.index(before.as_uvec3())];
                        if known == NONE || known == self.triangles[index] {
                            continue;
                        }
                        let found = facets[known as usize].nearest(centre);
                        if found.distance_squared < distances[index] {
                            self.triangles[index] = known;
                            distances[index] = found.distance_squared;
                        }
                    }
                }
            }
        }
    }

    /// Start triangle for a finite point; outside the box, the start triangle of the closest cell.
    #[inline]
    pub(super) fn at(&self, p: DVec3) -> u32 {
        self.triangles[self.index(self.cell(p))]
    }

    #[inline]
    fn cell(&self, p: DVec3) -> UVec3 {
        let last = (self.size - UVec3::ONE).as_dvec3();
        ((p - self.lo) * self.per_mm)
            .clamp(DVec3::ZERO, last)
            .as_uvec3()
    }

    #[inline]
    fn index(&self, at: UVec3) -> usize {
        ((at.z * self.size.y + at.y) * self.size.x + at.x) as usize
    }

    fn centre(&self, at: UVec3) -> DVec3 {
        self.lo + (at.as_dvec3() + 0.5) / self.per_mm
    }
}
