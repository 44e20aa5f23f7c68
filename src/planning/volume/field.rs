//! Displacement fields: one vector per voxel.

use super::grid::{Grid, cell, listed};
use glam::DVec3;
use phasmid_core::error::{Error, Result};

/// Maximum displacement in millimetres: no organ moves that far, so larger values have other units.
const LONGEST_MM: f32 = 500.0;

/// A displacement at each voxel of a grid, in millimetres along the axes of the patient frame (not
/// of the grid), as in ITK, elastix and plastimatch.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    grid: Grid,
    vectors: Vec<[f32; 3]>,
}

impl Field {
    /// Creates a field from vectors, i fastest, then j, then k. `place` names it in messages.
    ///
    /// # Errors
    /// Returns the errors of [`Grid::checked`], and an error if the number of vectors differs from
    /// that of the voxels, or if a vector is not finite or longer than 500 mm.
    pub fn new(grid: Grid, vectors: Vec<[f32; 3]>, place: &str) -> Result<Self> {
        let grid = grid.checked(place)?;
        if vectors.len() != grid.voxels() {
            return Err(Error::input(
                place,
                format!("{} vectors", vectors.len()),
                format!("{}, one per voxel of its grid", grid.voxels()),
            ));
        }
        let short = |v: &[f32; 3]| v.iter().map(|x| x * x).sum::<f32>() <= LONGEST_MM * LONGEST_MM;
        if let Some(at) = vectors.iter().position(|v| !short(v)) {
            let found = DVec3::from_array(vectors[at].map(f64::from));
            return Err(Error::input(
                format!("{place}: voxel {at}"),
                format!("a displacement of {}", listed(found)),
                format!("finite displacements within {LONGEST_MM} mm"),
            ));
        }
        Ok(Self { grid, vectors })
    }

    /// Creates a field from a function of the voxels' centres, both in millimetres.
    ///
    /// # Errors
    /// Returns the errors of [`Field::new`].
    pub fn of(grid: Grid, value: impl Fn(DVec3) -> DVec3 + Sync, place: &str) -> Result<Self> {
        use rayon::prelude::*;
        let grid = grid.checked(place)?;
        let [ni, nj, _] = grid.size;
        let mut vectors = vec![[0.0_f32; 3]; grid.voxels()];
        vectors
            .par_chunks_mut(ni * nj)
            .enumerate()
            .for_each(|(k, slice)| {
                for (at, vector) in slice.iter_mut().enumerate() {
                    let index = [at % ni, at / ni, k].map(|x| x as f64);
                    let u = value(grid.point(DVec3::from_array(index)));
                    *vector = u.to_array().map(|x| x as f32);
                }
            });
        Self::new(grid, vectors, place)
    }

    /// Returns the grid.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Returns the vectors, i fastest, then j, then k.
    pub fn vectors(&self) -> &[[f32; 3]] {
        &self.vectors
    }

    /// Returns the displacement at a point in the patient frame, both in millimetres, by trilinear
    /// interpolation. In the outer half of the outermost voxels, returns the displacement at the
    /// nearest point between centres; outside the voxels, `None`.
    #[inline]
    pub fn at(&self, point_mm: DVec3) -> Option<DVec3> {
        let index = self.grid.index(point_mm);
        self.grid.holds(index).then(|| self.nearest(index))
    }

    /// Returns the displacement at an index, clamped to the outermost centres.
    pub fn nearest(&self, index: DVec3) -> DVec3 {
        let cell = cell(&self.grid, index);
        (0..8).fold(DVec3::ZERO, |sum, c| {
            let u = self.vectors[cell.offsets[c]].map(f64::from);
            sum + cell.weights[c] * DVec3::from_array(u)
        })
    }

    /// Returns the length of the longest displacement, in millimetres.
    pub fn longest_mm(&self) -> f64 {
        let square = |v: &[f32; 3]| v.iter().map(|&x| f64::from(x) * f64::from(x)).sum();
        self.vectors.iter().map(square).fold(0.0, f64::max).sqrt()
    }

    /// Returns the field with its grid shifted by `shift_mm`; the displacements are unchanged.
    #[must_use]
    pub fn shifted(mut self, shift_mm: DVec3) -> Self {
        self.grid = self.grid.shifted(shift_mm);
        self
    }
}
