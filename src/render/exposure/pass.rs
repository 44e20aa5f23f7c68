//! Exposure pass: the pattern's light at each pixel, averaged over the pixel's footprint.
//!
//! A pattern that varies along one axis is averaged exactly by its [`RowTable`], or by kernels on
//! its [`HeldRow`] where the projector is out of focus. An image is averaged by its [`ImageTable`].

use super::super::{Plan, Term};
use super::buffer::GeometryBuffer;
use super::image_table::ImageTable;
use super::kernel::{HeldRow, Kernels};
use super::levels::Curve;
use super::row_table::{LANES, RowTable};
use super::{diffused, flicker};
use crate::pattern_image::PatternImage;
use phasmid_core::simd::widest;
use phasmid_pattern::Axis;
use phasmid_profile::Projector;

/// A pattern prepared for averaging.
pub(crate) enum Table {
    /// Uniform light, relative to full white.
    Uniform(f32),
    /// Levels along one axis, and the row for kernels if there is projector defocus or skin.
    Row(Axis, RowTable, Option<HeldRow>),
    /// Levels of an image that varies along both axes.
    Image(ImageTable),
}

impl Table {
    /// Prepares a pattern for a projector, with the terms of the plan.
    pub(crate) fn new(pattern_image: &PatternImage, projector: &Projector, plan: &Plan) -> Self {
        let curve = Curve::new(projector, plan);
        match pattern_image {
            PatternImage::Uniform(level) => Self::Uniform(curve.light(*level) as f32),
            PatternImage::Row(axis, levels) => {
                let blurs = plan.has(Term::ProjectorDefocus) || plan.has(Term::Subsurface);
                let held = blurs.then(|| {
                    let light: Vec<_> = levels.iter().map(|&level| curve.light(level)).collect();
                    HeldRow::new(&light)
                });
                let (integers, scale) = curve.integers(levels);
                Self::Row(*axis, RowTable::new(&integers, scale), held)
            }
            PatternImage::Image {
                width,
                height,
                levels,
            } => {
                let (integers, scale) = curve.integers(levels);
                let size = (*width as usize, *height as usize);
                Self::Image(ImageTable::new(size.0, size.1, &integers, scale))
            }
        }
    }

    /// Returns the memory size of the table in bytes.
    pub(crate) fn bytes(&self) -> usize {
        match self {
            Self::Uniform(_) => 0,
            Self::Row(_, row, held) => row.bytes() + held.as_ref().map_or(0, HeldRow::bytes),
            Self::Image(image) => image.bytes(),
        }
    }
}

/// Computes the mean electrons of the pixels that start at index `first`, except mixed pixels:
/// exposure time times the sum of ambient and pattern light.
///
/// `seconds` is the exposure time, `light` the projector's light relative to full (0 when off), and
/// `swing` the exposure time times the mean of the flicker over it, if any light flickers.
pub(crate) fn run(
    map: &GeometryBuffer,
    table: &Table,
    [seconds, light]: [f32; 2],
    swing: Option<f32>,
    first: usize,
    electrons: &mut [f32],
) {
    average(map, table, [seconds, light], first, electrons);
    if let Some(swing) = swing {
        flicker::add(map, swing, first, electrons);
    }
}

/// Computes the mean electrons from steady light.
fn average(
    map: &GeometryBuffer,
    table: &Table,
    [seconds, light]: [f32; 2],
    first: usize,
    electrons: &mut [f32],
) {
    match table {
        Table::Uniform(level) => uniform(map, *level, [seconds, light], first, electrons),
        Table::Row(axis, row, held) => {
            let (slope, kernels) = match axis {
                Axis::X => (&map.x_slope, &map.kernels[0]),
                Axis::Y => (&map.y_slope, &map.kernels[1]),
            };
            let x = map.lit_from(*axis);
            along_row(map, row, (x, slope), [seconds, light], first, electrons);
            if let (Some(kernels), Some(held)) = (kernels, held) {
                blurred(map, kernels, held, [seconds, light], first, electrons);
            }
        }
        Table::Image(image) => {
            for (k, e) in electrons.iter_mut().enumerate() {
                let i = first + k;
                let lit = map.projected[i];
                let level = if lit > 0.0 {
                    let blur = map.blur_along(map.blur.get(i).copied().unwrap_or(0.0));
                    let slopes = (map.x_slope[i], map.y_slope[i]);
                    image.average([map.x[i], map.y[i]], slopes.0, slopes.1, blur)
                } else {
                    0.0
                };
                *e = seconds * (map.ambient[i] + light * lit * level);
            }
            if let Some(skin) = &map.skin {
                diffused::pixels(map, skin, image, [seconds, light], first, electrons);
            }
        }
    }
}

/// Returns the mean electrons that the mixed pixel with index `index` gets from steady light.
pub(crate) fn mixed(
    map: &GeometryBuffer,
    index: usize,
    table: &Table,
    [seconds, light]: [f32; 2],
) -> f32 {
    let pixel = &map.mixed[index];
    let mut levels: [f32; 16] = match table {
        Table::Uniform(level) => [*level; 16],
        Table::Row(Axis::X, row, _) => row.average_mixed(&pixel.x, &pixel.x_slope),
        Table::Row(Axis::Y, row, _) => row.average_mixed(&pixel.y, &pixel.y_slope),
        Table::Image(image) => std::array::from_fn(|k| {
            let slopes = (pixel.x_slope[k], pixel.y_slope[k]);
            let blur = map.blur_along(pixel.blur[k]);
            image.average([pixel.x[k], pixel.y[k]], slopes.0, slopes.1, blur)
        }),
    };
    if let Table::Row(axis, _, Some(held)) = table
        && let Some(kernels) = &map.kernels[usize::from(*axis == Axis::Y)]
    {
        let first = map.x.len() + 16 * index;
        for (k, level) in levels.iter_mut().enumerate() {
            if let Some(average) = kernels.average(first + k, held) {
                *level = average;
            }
        }
    }
    if let (Table::Image(image), Some(skin)) = (table, &map.skin) {
        diffused::samples(map, skin, image, pixel, &mut levels);
    }
    let sum: f32 = levels
        .iter()
        .zip(&pixel.projected)
        .map(|(l, p)| l * p)
        .sum();
    seconds * (pixel.ambient + light * sum / pixel.projected.len() as f32)
}

widest! {
    fn blurred(
        map: &GeometryBuffer, kernels: &Kernels, row: &HeldRow, exposure: [f32; 2], first: usize,
        electrons: &mut [f32],
    ) => blurred_body
}
/// Replaces the result of `along_row` for the pixels that have a blur kernel.
#[inline(always)]
fn blurred_body(
    map: &GeometryBuffer,
    kernels: &Kernels,
    row: &HeldRow,
    [seconds, light]: [f32; 2],
    first: usize,
    electrons: &mut [f32],
) {
    let range = first..first + electrons.len();
    let light = light * seconds;
    let maps = map.ambient[range.clone()].iter().zip(&map.projected[range]);
    for (k, (e, (ambient, projected))) in electrons.iter_mut().zip(maps).enumerate() {
        if let Some(level) = kernels.average(first + k, row) {
            *e = seconds * ambient + light * projected * level;
        }
    }
}

widest! {
    fn uniform(
        map: &GeometryBuffer, level: f32, exposure: [f32; 2], first: usize, electrons: &mut [f32],
    ) => uniform_body
}
widest! {
    fn along_row(
        map: &GeometryBuffer, row: &RowTable, coordinate: (&[f32], &[[f32; 2]]), exposure: [f32; 2],
        first: usize, electrons: &mut [f32],
    ) => along_row_body
}

#[inline(always)]
fn uniform_body(
    map: &GeometryBuffer,
    level: f32,
    [seconds, light]: [f32; 2],
    first: usize,
    electrons: &mut [f32],
) {
    let range = first..first + electrons.len();
    let (ambient, projected) = (&map.ambient[range.clone()], &map.projected[range]);
    for ((e, a), p) in electrons.iter_mut().zip(ambient).zip(projected) {
        *e = seconds * (a + light * p * level);
    }
}

#[inline(always)]
fn along_row_body(
    map: &GeometryBuffer,
    row: &RowTable,
    (x, slope): (&[f32], &[[f32; 2]]),
    [seconds, light]: [f32; 2],
    first: usize,
    electrons: &mut [f32],
) {
    let range = first..first + electrons.len();
    let ambient = map.ambient[range.clone()].chunks(LANES);
    let projected = map.projected[range.clone()].chunks(LANES);
    let x = x[range.clone()].chunks(LANES);
    let slope = slope[range].chunks(LANES);
    let light = light * seconds;
    let blocks = electrons
        .chunks_mut(LANES)
        .zip(ambient)
        .zip(projected)
        .zip(x)
        .zip(slope);
    for ((((e, ambient), projected), x), slope) in blocks {
        for (e, a) in e.iter_mut().zip(ambient) {
            *e = seconds * a;
        }
        // Unlit pixels come in long runs, so the branch is cheaper than their lookups.
        if projected.iter().all(|&p| p == 0.0) {
            continue;
        }
        let level = match (x.try_into(), slope.try_into()) {
            (Ok(x), Ok(slope)) => row.average(x, slope),
            // The last block of the image is padded to a full block.
            _ => {
                let (mut xs, mut slopes) = ([0.0; LANES], [[0.0; 2]; LANES]);
                xs[..x.len()].copy_from_slice(x);
                slopes[..x.len()].copy_from_slice(slope);
                row.average(&xs, &slopes)
            }
        };
        for ((e, &p), level) in e.iter_mut().zip(projected).zip(level) {
            // The level is NaN for a pixel that sees no surface.
            *e += if p > 0.0 { light * p * level } else { 0.0 };
        }
    }
}
