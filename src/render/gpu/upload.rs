//! Transfers the CPU's geometry maps to the GPU and back, to test single passes.

use super::Engine;
use super::engine::words;
use super::geometry::reserve_maps;
use super::mixed::MixedSample;
use crate::exposure::{GeometryBuffer, Mixed};
use crate::{Plan, Term};

/// Uploads the geometry maps. Missing values are written as 0, not NaN.
pub(crate) fn maps(engine: &mut Engine, map: &GeometryBuffer) {
    reserve_maps(engine, map.x.len());
    let real = |v: f32| if v.is_finite() { v } else { 0.0 };
    let pixels = 0..map.x.len();
    let place: Vec<[f32; 2]> = pixels
        .clone()
        .map(|i| [map.x[i], map.y[i]].map(real))
        .collect();
    let slope = |slopes: &[[f32; 2]], i: usize| slopes.get(i).copied().unwrap_or_default();
    let slopes: Vec<[f32; 4]> = pixels
        .clone()
        .map(|i| {
            let ([a, b], [c, d]) = (slope(&map.x_slope, i), slope(&map.y_slope, i));
            [a, b, c, d].map(real)
        })
        .collect();
    let light: Vec<[f32; 2]> = pixels
        .clone()
        .map(|i| [map.projected[i], map.ambient[i]])
        .collect();
    let seen: Vec<[f32; 4]> = pixels
        .map(|i| {
            let [x, y, z] = map.normal[i];
            [x, y, z, map.depth[i]].map(real)
        })
        .collect();
    let marks: Vec<u32> = map.flags.iter().map(|&f| u32::from(f)).collect();
    engine.write("place", bytemuck::cast_slice(&place));
    engine.write("slopes", bytemuck::cast_slice(&slopes));
    engine.write("light", bytemuck::cast_slice(&light));
    engine.write("seen", bytemuck::cast_slice(&seen));
    engine.write("surface", bytemuck::cast_slice(&map.surface));
    engine.write("marks", bytemuck::cast_slice(&marks));
    engine.write("lamp_bits", bytemuck::cast_slice(&map.lamps));
    engine.write("flickering", bytemuck::cast_slice(&map.flickering));
    engine.write("blur", bytemuck::cast_slice(&map.blur));
    engine.write("evenly", bytemuck::cast_slice(&map.evenly));
}

/// Reads the GPU's geometry maps back in the CPU's layout; the samples of mixed pixels are not read.
pub(crate) fn maps_back(
    engine: &Engine,
    (width, height): (usize, usize),
    plan: &Plan,
) -> phasmid_core::error::Result<GeometryBuffer> {
    let n = (width * height) as u64;
    let mut map = GeometryBuffer::default();
    map.resize(width, height, plan);
    let place: Vec<[f32; 2]> = words(engine, "place", n)?;
    let slopes: Vec<[f32; 4]> = words(engine, "slopes", n)?;
    let light: Vec<[f32; 2]> = words(engine, "light", n)?;
    let seen: Vec<[f32; 4]> = words(engine, "seen", n)?;
    map.surface = words(engine, "surface", n)?;
    let marks: Vec<u32> = words(engine, "marks", n)?;
    for i in 0..width * height {
        map.flags[i] = marks[i] as u8;
        let none = map.surface[i] == u32::MAX;
        let there = |v: f32| if none { f32::NAN } else { v };
        (map.x[i], map.y[i]) = (there(place[i][0]), there(place[i][1]));
        if let Some(slope) = map.x_slope.get_mut(i) {
            *slope = [slopes[i][0], slopes[i][1]];
        }
        if let Some(slope) = map.y_slope.get_mut(i) {
            *slope = [slopes[i][2], slopes[i][3]];
        }
        [map.projected[i], map.ambient[i]] = light[i];
        let [x, y, z, depth] = seen[i];
        (map.normal[i], map.depth[i]) = ([x, y, z], there(depth));
    }
    if plan.has(Term::Lights) {
        map.lamps = words(engine, "lamp_bits", n)?;
    }
    if plan.has(Term::Flicker) {
        map.flickering = words(engine, "flickering", n)?;
    }
    if plan.has(Term::ProjectorDefocus) {
        map.blur = words(engine, "blur", n)?;
    }
    if plan.has(Term::Interreflection) {
        map.evenly = words(engine, "evenly", n)?;
    }
    Ok(map)
}

impl MixedSample {
    fn new(mixed: &Mixed, k: usize) -> Self {
        Self {
            place: [mixed.x[k], mixed.y[k]],
            slopes: [mixed.x_slope[k], mixed.y_slope[k]],
            projected: mixed.projected[k],
            blur: mixed.blur[k],
        }
    }
}

/// Uploads the mixed pixels in order.
pub(crate) fn mixed(engine: &mut Engine, map: &GeometryBuffer) {
    let mut heads = Vec::with_capacity(map.mixed.len());
    for groups in map.mixed.chunk_by(|a, b| a.pixel == b.pixel) {
        for (i, mixed) in groups.iter().enumerate() {
            let count = if i == 0 { groups.len() as u32 } else { 0 };
            let [ambient, swing] = [mixed.ambient, mixed.flickering].map(f32::to_bits);
            heads.push([mixed.pixel, count, ambient, swing]);
        }
    }
    let all = |mixed: &Mixed| std::array::from_fn::<_, 16, _>(|k| MixedSample::new(mixed, k));
    let samples: Vec<_> = map.mixed.iter().flat_map(all).collect();
    let [across, down, _] = super::grid(heads.len());
    // Number of heads, their workgroup counts along three dimensions, and number of heads needed.
    let count = [heads.len() as u32, across, down, 1, heads.len() as u32];
    engine.write("mixed_heads", bytemuck::cast_slice(&heads));
    engine.write("mixed_samples", bytemuck::cast_slice(&samples));
    engine.write("mixed_count", bytemuck::cast_slice(&count));
}
