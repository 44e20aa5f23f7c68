//! Volumes of numbers: Hounsfield units, or anything else with one value a voxel.

use super::grid::Grid;
use super::trilinear::cell;
use glam::DVec3;
use phasmid_core::error::{Error, Result};

/// The numbers of a volume, i fastest, then j, then k.
#[derive(Debug, Clone, PartialEq)]
pub enum Voxels {
    /// Whole numbers, as a CT's Hounsfield units are.
    I16(Vec<i16>),
    /// Anything else; finite.
    F32(Vec<f32>),
}

impl Voxels {
    /// How many.
    pub fn len(&self) -> usize {
        match self {
            Self::I16(v) => v.len(),
            Self::F32(v) => v.len(),
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// One of them.
    ///
    /// # Panics
    /// Where there is none of that number.
    #[inline]
    pub fn get(&self, offset: usize) -> f32 {
        match self {
            Self::I16(v) => f32::from(v[offset]),
            Self::F32(v) => v[offset],
        }
    }
}

/// A number at each voxel of a grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Volume {
    grid: Grid,
    voxels: Voxels,
}

impl Volume {
    /// A volume. `place` names it in messages.
    ///
    /// # Errors
    /// What [`Grid::checked`] refuses; as many numbers as are not the grid's; one that is not finite.
    pub fn new(grid: Grid, voxels: Voxels, place: &str) -> Result<Self> {
        let grid = grid.checked(place)?;
        if voxels.len() != grid.voxels() {
            return Err(Error::input(
                place,
                format!("{} numbers", voxels.len()),
                format!("{}, as its grid has voxels", grid.voxels()),
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

    /// A volume whose number at each voxel is a function of its centre, in millimetres.
    ///
    /// # Errors
    /// As for [`Volume::new`].
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

    /// Where its voxels lie.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Its numbers.
    pub fn voxels(&self) -> &Voxels {
        &self.voxels
    }

    /// The number at a point in the patient frame, in millimetres, trilinear between centres. In
    /// the outer half of the outermost voxels it is that of the nearest point between centres;
    /// beyond the voxels it is `None`.
    #[inline]
    pub fn at(&self, point_mm: DVec3) -> Option<f64> {
        let index = self.grid.index(point_mm);
        self.grid.holds(index).then(|| self.nearest(index))
    }

    /// The number at an index; beyond the outermost centres that of the nearest point between them.
    pub fn nearest(&self, index: DVec3) -> f64 {
        let cell = cell(&self.grid, index);
        (0..8)
            .map(|c| cell.weights[c] * f64::from(self.voxels.get(cell.offsets[c])))
            .sum()
    }

    /// The same volume with its grid elsewhere by `shift_mm`.
    #[must_use]
    pub fn shifted(mut self, shift_mm: DVec3) -> Self {
        self.grid = self.grid.shifted(shift_mm);
        self
    }
}
