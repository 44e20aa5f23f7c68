//! Computes where the light seen at each pixel entered the skin: fills the skin maps in the geometry
//! pass.

use super::cast::Cast;
use super::rays::Rays;
use crate::exposure::{GeometryBuffer, Mixed, Optics, SkinMaps};
use crate::scene::{Surface, World};
use crate::skin::{NONE, Scatter};
use crate::truth::Truth;
use glam::DVec3;
use rayon::prelude::*;

impl SkinMaps {
    /// Computes the maps at all pixel centres, where rays start at the rig's origin.
    pub(super) fn new(
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
                    if let Some(scatter) = at(map, rays, optics, world, row * width + column) {
                        x[column] += scatter.shift_px[0];
                        y[column] += scatter.shift_px[1];
                        px_per_mm[column] = scatter.px_per_mm;
                        tissue[column] = scatter.tissue;
                    }
                }
            });
        maps
    }

    /// Computes the maps again at some pixels.
    pub(super) fn renew(
        &mut self,
        map: &GeometryBuffer,
        rays: &Rays<'_>,
        optics: &Optics,
        world: &World,
        pixels: &[u32],
    ) {
        let scatter = |&pixel: &u32| at(map, rays, optics, world, pixel as usize);
        let found: Vec<_> = pixels.par_iter().map(scatter).collect();
        for (&pixel, scatter) in pixels.iter().zip(found) {
            let i = pixel as usize;
            let shift_px = scatter.map_or([0.0; 2], |scatter| scatter.shift_px);
            self.from[0][i] = map.x[i] + shift_px[0];
            self.from[1][i] = map.y[i] + shift_px[1];
            self.px_per_mm[i] = scatter.map_or([0.0; 2], |scatter| scatter.px_per_mm);
            self.tissue[i] = scatter.map_or(NONE, |scatter| scatter.tissue);
        }
    }
}

/// Returns the light transport under the skin at the centre of the pixel with index `i`; `None` if it
/// does not see lit skin.
fn at(
    map: &GeometryBuffer,
    rays: &Rays<'_>,
    optics: &Optics,
    world: &World,
    i: usize,
) -> Option<Scatter> {
    if map.flags[i] & Truth::LIT == 0 {
        return None;
    }
    let point = rays.center(i % map.width, i / map.width) * f64::from(map.depth[i]);
    let normal = DVec3::from_array(map.normal[i].map(f64::from));
    let object = world.object(Surface(map.surface[i]));
    optics.skins.at(object, point, normal)
}

/// Applies light transport under the skin to the `k`th sample of a mixed pixel, which must be lit.
pub(super) fn into_sample(
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
