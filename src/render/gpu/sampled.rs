//! Passes that sample pixels with several rays: either mixed pixels only or all pixels. Also uploads
//! tables of pupil points and rotations for `aperture.wgsl`, so that the samples match the CPU's
//! samples.

#[cfg(test)]
mod tests;

use super::engine::Commands;
use super::mixed::{self, Room};
use super::{Engine, EntryPoint, grid};
use crate::exposure::Optics;
use crate::material::Materials;
use crate::scene::Worlds;
use crate::transport::{Aperture, pupil_index, turn};
use crate::{Options, Plan, Term};
use bytemuck::{Pod, Zeroable};
use glam::DVec2;
use phasmid_core::error::Result;
use phasmid_geometry::raycast::LANES;

/// Twin of `Sampling` in `sampling.wgsl`, without its tables.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct SamplingData {
    size: [u32; 2],
    rows: u32,
    room: u32,
    pixel_slope: f32,
    focus: f32,
    spread: f32,
    turns: u32,
    varies: u32,
    pixel_aspect: f32,
    spare: [u32; 2],
}

/// Samples pixels with several rays.
pub(crate) struct Sampler {
    aperture: Aperture,
    /// Number of samples along a side of a pixel.
    side: usize,
    room: Room,
    data: SamplingData,
    /// Bit mask with one bit per object, set if the object's albedo varies over its surface.
    varies: Vec<[u32; 2]>,
}

impl Sampler {
    /// Uploads the data that these passes need in addition to maps, optics and world.
    pub(crate) fn new(
        engine: &mut Engine,
        worlds: &Worlds,
        optics: &Optics,
        plan: &Plan,
        options: Options,
        aperture: Aperture,
    ) -> Self {
        let lens = &optics.camera.lens;
        let depth_of_field = plan.has(Term::DepthOfField) && aperture.radius_mm > 0.0;
        let side = options.side(depth_of_field);
        let pixels = u64::from(lens.width_px) * u64::from(lens.height_px);
        // Typical need: mixed pixels at edges and, with depth of field, some of the blurred pixels.
        let heads = match side {
            1 | 2 => pixels / 16,
            _ => pixels / 4,
        };
        let data = SamplingData {
            size: [lens.width_px, lens.height_px],
            pixel_slope: (1.0 / lens.focal_px.min_element()) as f32,
            focus: aperture.focus as f32,
            spread: (aperture.focal_px * aperture.radius_mm) as f32,
            turns: (side * side) as u32,
            pixel_aspect: aperture.pixel_aspect as f32,
            ..SamplingData::zeroed()
        };
        engine.reserve("candidates", pixels * 4);
        engine.reserve("candidate_count", 16);
        for name in ["mixed_skin", "skin_of"] {
            engine.provide(name);
        }
        let mut sampler = Self {
            aperture,
            side,
            room: Room::new(engine, heads, plan.has(Term::Subsurface)),
            data,
            varies: varies(&worlds.any().materials),
        };
        sampler.room.reserve(engine);
        // Sample counts recorded under the previous plan no longer apply.
        mixed::forget(engine);
        sampler.see(engine, worlds);
        sampler
    }

    /// Updates the sampling for a scene that all rows now see at the same time, or that each row
    /// sees at its own time.
    pub(crate) fn see(&mut self, engine: &mut Engine, worlds: &Worlds) {
        let rows = worlds.rows_together() as u32;
        if self.data.rows != rows {
            self.data.rows = rows;
            self.write(engine);
        }
    }

    /// Returns the capacity for mixed pixels in groups of sixteen samples.
    pub(super) fn room(&self) -> u64 {
        self.room.heads
    }

    fn write(&mut self, engine: &mut Engine) {
        let size = self.data.size.map(|n| n as usize);
        let turns = turns(size.into(), self.data.rows as usize);
        let points = points(&self.aperture, self.side);
        let pairs: Vec<[f32; 2]> = points.chain(turns).collect();
        self.data.varies = pairs.len() as u32;
        self.data.room = self.room.heads as u32;
        let parts: [&[u8]; 3] = [
            bytemuck::bytes_of(&self.data),
            bytemuck::cast_slice(&pairs),
            bytemuck::cast_slice(&self.varies),
        ];
        engine.write("sampling", &parts.concat());
    }

    /// Adds the passes that follow the pass over pixel centres. They must be submitted together with
    /// that pass.
    ///
    /// # Errors
    /// Returns an error if the GPU has failed.
    pub(crate) fn run(
        &self,
        engine: &mut Engine,
        commands: &mut Commands,
        plan: &Plan,
    ) -> Result<()> {
        let pixels = (self.data.size[0] * self.data.size[1]) as usize;
        let samples = pixels * self.side * self.side;
        let through_pupil = self.aperture.radius_mm > 0.0;
        let sampled = |entry| {
            EntryPoint::new("sampled", entry, plan)
                .with("side", self.side as f64)
                .with("through_pupil", u8::from(through_pupil).into())
        };
        let mixed = |entry| EntryPoint::new("mixed", entry, plan);
        engine.run(commands, &mixed("clear"), [1; 3])?;
        match self.side {
            1 => {}
            2 => engine.run(commands, &sampled("mark"), grid(samples))?,
            _ => engine.run(commands, &sampled("gather"), grid(samples))?,
        }
        if self.side < 4 {
            engine.run(commands, &mixed("find"), grid(pixels))?;
            engine.run(commands, &mixed("ready"), [1; 3])?;
            let sample = EntryPoint::new("mixed_sample", "main", plan);
            engine.run_indirect(commands, &sample, "candidate_count", 4)?;
        }
        engine.run(commands, &mixed("close"), [1; 3])?;
        if plan.has(Term::DepthOfField) {
            engine.run(
                commands,
                &EntryPoint::new("widen", "main", plan),
                grid(pixels),
            )?;
        }
        Ok(())
    }

    /// Grows the capacity if mixed pixels needed more sample groups than it has; `wanted` is the
    /// last word of `mixed_count`. Returns whether the capacity has grown; the pass over pixel
    /// centres and these passes must then be run again.
    ///
    /// # Errors
    /// Returns an error if the adapter cannot hold the mixed pixels.
    pub(crate) fn has_grown(&mut self, engine: &mut Engine, wanted: u64) -> Result<bool> {
        let grown = self.room.grow(wanted)?;
        if grown {
            self.room.reserve(engine);
            self.write(engine);
        }
        Ok(grown)
    }
}

fn varies(materials: &Materials) -> Vec<[u32; 2]> {
    let mut varies = vec![[0u32; 2]; materials.len().div_ceil(64)];
    for object in (0..materials.len()).filter(|&object| materials.vary(object as u16)) {
        varies[object / 64][object / 32 % 2] |= 1 << (object % 32);
    }
    varies
}

/// Returns the pupil points for `side` x `side` samples, in sample order.
fn points(aperture: &Aperture, side: usize) -> impl Iterator<Item = [f32; 2]> {
    let count = side * side;
    (0..count).map(move |k| {
        let point = aperture.point(pupil_index(k, count), count, 0.0);
        point.truncate().as_vec2().to_array()
    })
}

/// Returns the cosine and sine of the rotation of each tile of sixteen pixels; a tile covers `rows`
/// rows.
fn turns((width, height): (usize, usize), rows: usize) -> impl Iterator<Item = [f32; 2]> {
    let tiles = width.div_ceil(LANES / rows) * height.div_ceil(rows);
    (0..tiles).map(|tile| DVec2::from_angle(turn(tile)).as_vec2().to_array())
}
