//! Skin data from the geometry pass for the later passes.

use super::super::buffer::{GeometryBuffer, Mixed};
use super::super::exposure::Spread;
use super::super::geometry::{Cast, Rays};
use super::super::shade::Optics;
use super::super::world::{Surface, World};
use super::{NONE, SkinMaterial};
use crate::truth::Truth;
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Skin maps over the camera's pixels, row-major. The projector coordinates in the geometry buffer
/// still belong to the surface point and serve as ground truth, so that measurements show the error
/// that skin causes.
#[derive(Debug, Clone)]
pub(crate) struct SkinMaps {
    /// Projector column and row where the light seen at the pixel centre entered the surface: the
    /// point's own coordinates, shifted on skin.
    pub(crate) from: [Vec<f32>; 2],
    /// Projector pixels per millimetre of skin along the gradients of column and row.
    px_per_mm: Vec<[f32; 2]>,
    /// Index of the tissue; `NONE` for pixels that are not lit skin.
    tissue: Vec<u16>,
    materials: Arc<[SkinMaterial]>,
}

/// The same data for the sixteen samples of a mixed pixel, whose coordinates are already shifted.
#[derive(Debug, Clone)]
pub(crate) struct Samples {
    px_per_mm: [[f32; 2]; 16],
    tissue: [u16; 16],
}

impl Default for Samples {
    fn default() -> Self {
        Self {
            px_per_mm: [[0.0; 2]; 16],
            tissue: [NONE; 16],
        }
    }
}

#[cfg(test)]
impl Samples {
    /// Returns the projector pixels per millimetre of a sample's skin, and the index of its tissue.
    pub(crate) fn at(&self, k: usize) -> ([f32; 2], u16) {
        (self.px_per_mm[k], self.tissue[k])
    }
}

impl SkinMaps {
    /// Computes the maps at all pixel centres, whose rays start at the rig's origin.
    pub(crate) fn new(
        map: &GeometryBuffer,
        rays: &Rays<'_>,
        optics: &Optics,
        world: &World,
    ) -> Self {
        let mut maps = Self {
            from: [map.x.clone(), map.y.clone()],
            px_per_mm: vec![[0.0; 2]; map.x.len()],
            tissue: vec![NONE; map.x.len()],
            materials: optics.skins.materials.clone(),
        };
        let [x, y] = &mut maps.from;
        let width = map.width;
        (x.par_chunks_mut(width), y.par_chunks_mut(width))
            .into_par_iter()
            .zip(maps.px_per_mm.par_chunks_mut(width))
            .zip(maps.tissue.par_chunks_mut(width))
            .enumerate()
            .for_each(|(row, (((x, y), px_per_mm), tissue))| {
                for column in 0..width {
                    let i = row * width + column;
                    if map.flags[i] & Truth::LIT == 0 {
                        continue;
                    }
                    let point = rays.center(column, row) * f64::from(map.depth[i]);
                    let normal = DVec3::from_array(map.normal[i].map(f64::from));
                    let object = world.object(Surface(map.surface[i]));
                    if let Some(scatter) = optics.skins.at(object, point, normal) {
                        x[column] += scatter.shift_px[0];
                        y[column] += scatter.shift_px[1];
                        px_per_mm[column] = scatter.px_per_mm;
                        tissue[column] = scatter.tissue;
                    }
                }
            });
        maps
    }

    /// Returns the projector pixels per millimetre of a pixel's skin, and the index of its tissue.
    #[cfg(test)]
    pub(crate) fn at(&self, i: usize) -> ([f32; 2], u16) {
        (self.px_per_mm[i], self.tissue[i])
    }

    /// Returns the spread of the projected light at a pixel along one axis of the pattern image;
    /// `None` if the pixel is not lit skin.
    pub(crate) fn spread(&self, i: usize, axis: usize) -> Option<Spread<'_>> {
        self.of(self.tissue[i], self.px_per_mm[i], axis)
    }

    /// Returns the same for a sample of a mixed pixel.
    pub(crate) fn sample(&self, samples: &Samples, k: usize, axis: usize) -> Option<Spread<'_>> {
        self.of(samples.tissue[k], samples.px_per_mm[k], axis)
    }

    fn of(&self, tissue: u16, px_per_mm: [f32; 2], axis: usize) -> Option<Spread<'_>> {
        let material = self.materials.get(usize::from(tissue))?;
        Some(Spread {
            mixture: &material.mixture,
            px_per_mm: px_per_mm[axis],
        })
    }

    /// Returns the fraction of contrast that skin leaves of a fringe with a period of `period`
    /// projector pixels along an axis.
    pub(crate) fn contrast(&self, i: usize, axis: usize, period: f64) -> f64 {
        self.spread(i, axis).map_or(1.0, |spread| {
            let frequency = f64::from(spread.px_per_mm) / period;
            spread.mixture.transfer(TAU * frequency)
        })
    }
}

/// Applies skin transport to the `k`th sample of a mixed pixel, a lit point.
pub(crate) fn into_sample(
    world: &World,
    optics: &Optics,
    cast: &Cast,
    lane: usize,
    (mixed, k): (&mut Mixed, usize),
) {
    let object = world.object(cast.hits.surface[lane]);
    let (point, normal) = (cast.origin + cast.point(lane), cast.hits.normal(lane));
    if let Some(scatter) = optics.skins.at(object, point, normal) {
        mixed.x[k] += scatter.shift_px[0];
        mixed.y[k] += scatter.shift_px[1];
        let samples = mixed.skin.get_or_insert_default();
        samples.px_per_mm[k] = scatter.px_per_mm;
        samples.tissue[k] = scatter.tissue;
    }
}
