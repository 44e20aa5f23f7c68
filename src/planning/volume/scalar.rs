//! Scalar volumes: Hounsfield units, or any other single value per voxel.

use super::grid::{Grid, cell};
use glam::DVec3;
use phasmid_core::error::{Error, Result};

/// The values of a volume, i fastest, then j, then k.
#[derive(Debug, Clone, PartialEq)]
pub enum Voxels {
    /// Integers, such as the Hounsfield units of a CT.
    I16(Vec<i16>),
    /// All other values; finite.
    F32(Vec<f32>),
}

impl Voxels {
    /// Returns the number of values.
    pub fn len(&self) -> usize {
        match self {
            Self::I16(v) => v.len(),
            Self::F32(v) => v.len(),
        }
    }

    /// Returns whether there are no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the value at a memory index.
    ///
    /// # Panics
    /// Panics if the index is out of range.
    #[inline]
    pub fn get(&self, offset: usize) -> f32 {
        match self {
            Self::I16(v) => f32::from(v[offset]),
            Self::F32(v) => v[offset],
        }
    }
}

/// A value at each voxel of a grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Volume {
    grid: Grid,
    voxels: Voxels,
}

impl Volume {
    /// Creates a volume. `place` names it in messages.
    ///
    /// # Errors
    /// Returns the errors of [`Grid::checked`], and an error if the number of values differs from
    /// that of the voxels, or if a value is not finite.
    pub fn new(grid: Grid, voxels: Voxels, place: &str) -> Result<Self> {
        let grid = grid.checked(place)?;
        if voxels.len() != grid.voxels() {
            return Err(Error::input(
                place,
                format!("{} numbers", voxels.len()),
                format!("{}, one per voxel of its grid", grid.voxels()),
            ));
        }
        if let Voxels::F32(v) = &voxels
            && let Some(at) = v.iter().position(|x| !x.is_finite())
        {
            return Err(Error::input(
                format!("{place}: voxel {at}"),
                v[at],
                "finite numbers",
            ));
        }
        Ok(Self { grid, voxels })
    }

    /// Creates a volume from a function of the voxels' centres, in millimetres.
    ///
    /// # Errors
    /// Returns the errors of [`Volume::new`].
    pub fn of(grid: Grid, value: impl Fn(DVec3) -> f64 + Sync, place: &str) -> Result<Self> {
        use rayon::prelude::*;
        let grid = grid.checked(place)?;
        let [ni, nj, _] = grid.size;
        let mut voxels = vec![0.0_f32; grid.voxels()];
        voxels
            .par_chunks_mut(ni * nj)
            .enumerate()
            .for_each(|(k, slice)| {
                for (at, voxel) in slice.iter_mut().enumerate() {
                    let index = [at % ni, at / ni, k].map(|x| x as f64);
                    *voxel = value(grid.point(DVec3::from_array(index))) as f32;
                }
            });
        Self::new(grid, Voxels::F32(voxels), place)
    }

    /// Returns the grid.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Returns the values.
    pub fn voxels(&self) -> &Voxels {
        &self.voxels
    }

    /// Returns the value at a point in the patient frame, in millimetres, by trilinear interpolation.
    /// In the outer half of the outermost voxels, returns the value at the nearest point between
    /// centres; outside the voxels, `None`.
    #[inline]
    pub fn at(&self, point_mm: DVec3) -> Option<f64> {
        let index = self.grid.index(point_mm);
        self.grid.holds(index).then(|| self.nearest(index))
    }

    /// Returns the value at an index, clamped to the outermost centres.
    pub fn nearest(&self, index: DVec3) -> f64 {
        let cell = cell(&self.grid, index);
        (0..8)
            .map(|c| cell.weights[c] * f64::from(self.voxels.get(cell.offsets[c])))
            .sum()
    }

    /// Returns the volume with its grid shifted by `shift_mm`.
    #[must_use]
    pub fn shifted(mut self, shift_mm: DVec3) -> Self {
        self.grid = self.grid.shifted(shift_mm);
        self
    }
}
