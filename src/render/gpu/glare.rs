//! Veiling glare on the GPU. Equivalent of the CPU's `glare.rs`, which also computes the weights.

use super::engine::Commands;
use super::{Engine, EntryPoint, grid};
use crate::Plan;
use crate::glare::{Axis, axes, sigmas_px};
use bytemuck::{Pod, Zeroable};
use phasmid_core::error::Result;
use phasmid_profile as profile;

/// Number of pixels that one workgroup sums, as in `glare.wgsl`.
const PART: usize = 1024;

/// Applies veiling glare to images of one size.
pub(crate) struct Glare {
    pixels: usize,
    cells: usize,
}

/// Twin of `GlareSize` in `glare.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
struct Size {
    size: [u32; 2],
    cells: [u32; 2],
    span: [u32; 2],
    cover: [u32; 2],
    blur: [u32; 2],
    between: [u32; 2],
    share: f32,
    unused: [u32; 3],
}

impl Glare {
    /// Uploads the weights for an image of this size whose pixels have this aspect (width over
    /// height); returns `None` if there is no glare.
    pub(crate) fn new(
        engine: &mut Engine,
        glare: &profile::Glare,
        size: [usize; 2],
        pixel_aspect: f64,
    ) -> Option<Self> {
        let pixels = size[0] * size[1];
        if glare.percent == 0.0 || pixels == 0 {
            return None;
        }
        let axes = axes(size, sigmas_px(glare, pixel_aspect));
        let mut params = Size {
            size: size.map(|side| side as u32),
            share: (glare.percent / 100.0) as f32,
            ..Size::default()
        };
        let mut tables = Vec::new();
        for (k, axis) in axes.iter().enumerate() {
            params.cells[k] = axis.cells as u32;
            pack(axis, k, &mut params, &mut tables);
        }
        let cells = axes[0].cells * axes[1].cells;
        engine.write("glare", bytemuck::bytes_of(&params));
        engine.write("glare_tables", bytemuck::cast_slice(&tables));
        engine.reserve("glare_cells", 4 * cells as u64);
        engine.reserve("glare_across", 4 * cells as u64);
        engine.reserve("glare_sums", 16 * (1 + pixels.div_ceil(PART)) as u64);
        Some(Self { pixels, cells })
    }

    /// Adds the passes that apply glare to `electrons`.
    ///
    /// # Errors
    /// Returns an error if the GPU has failed.
    pub(crate) fn run(
        &self,
        engine: &mut Engine,
        commands: &mut Commands,
        plan: &Plan,
    ) -> Result<()> {
        // One workgroup per cell of the grid, and one per part of [`PART`] pixels.
        let (of_cells, of_parts) = (64 * self.cells, 64 * self.pixels.div_ceil(PART));
        for (entry, threads) in [
            ("cells", of_cells),
            ("across", self.cells),
            ("down", self.cells),
            ("parts", of_parts),
            ("whole", 1),
            ("main", self.pixels),
        ] {
            engine.run(
                commands,
                &EntryPoint::new("glare", entry, plan),
                grid(threads),
            )?;
        }
        Ok(())
    }
}

/// Appends the tables of one axis to `tables` and records their offsets in `params`.
fn pack(axis: &Axis, k: usize, params: &mut Size, tables: &mut Vec<u32>) {
    let span = axis.covers.iter().map(|(_, shares)| shares.len()).max();
    let span = span.unwrap_or(0);
    params.span[k] = span as u32;
    params.cover[k] = tables.len() as u32;
    for (first, shares) in &axis.covers {
        tables.push(*first as u32);
        let share = |i: usize| shares.get(i).copied().unwrap_or(0.0);
        tables.extend((0..span).map(|i| share(i).to_bits()));
    }
    params.blur[k] = tables.len() as u32;
    tables.extend(axis.weights.iter().map(|&w| (w as f32).to_bits()));
    params.between[k] = tables.len() as u32;
    for (first, over) in &axis.between {
        tables.extend([*first as u32, over.to_bits()]);
    }
}

#[cfg(test)]
mod tests {
    use super::super::engine;
    use super::*;
    use crate::glare;

    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn gpu_glare_matches_the_cpu() {
        let mut engine = Engine::for_tests();
        for (size, percent, sigma_px, aspect) in [
            ([402usize, 211usize], 8.0, 32.0, 1.0),
            ([402, 211], 30.0, 90.0, 1.0),
            ([402, 211], 8.0, 45.0, 0.6),
            ([402, 211], 8.0, 45.0, 1.7),
            ([1138, 489], 3.0, 63.0, 1.0),
            ([37, 19], 100.0, 50.0, 1.0),
            ([640, 3], 10.0, 3000.0, 1.0),
            ([1, 1], 10.0, 40.0, 1.0),
        ] {
            let [width, height] = size;
            let bright = |i: usize| (i % width) / 40 % 3 == 1 && (i / width) / 30 % 2 == 1;
            let before: Vec<f32> = (0..width * height)
                .map(|i| {
                    if bright(i) {
                        9000.0 + (i % 97) as f32
                    } else {
                        10.0
                    }
                })
                .collect();
            let glare = profile::Glare { percent, sigma_px };
            let mut cpu = before.clone();
            glare::spread(&mut cpu, width, &glare, aspect);
            engine.write("electrons", bytemuck::cast_slice(&before));
            let gpu = Glare::new(&mut engine, &glare, size, aspect).unwrap();
            let mut commands = engine.commands();
            gpu.run(&mut engine, &mut commands, &Plan::default())
                .unwrap();
            engine.submit(commands);
            let after: Vec<f32> = engine::words(&engine, "electrons", before.len() as u64).unwrap();
            let sum = |values: &[f32]| values.iter().map(|&v| f64::from(v)).sum::<f64>();
            let lost = (sum(&after) / sum(&before) - 1.0).abs();
            let off = |(a, b): (&f32, &f32)| (a - b).abs() / a;
            let worst = cpu.iter().zip(&after).map(off).fold(0.0, f32::max);
            println!("{size:?} {sigma_px}: {worst:.1e} off, {lost:.1e} of the light lost");
            assert!(worst < 3e-6 && lost < 1e-6, "{size:?}: {worst}, {lost}");
        }
    }
}
