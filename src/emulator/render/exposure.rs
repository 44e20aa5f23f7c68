//! The exposure pass: the slide's light at each pixel, averaged over the pixel's footprint.
//!
//! A slide that varies along one axis is averaged exactly by its [`RowTable`]; a picture by its
//! [`PictureTable`].

use super::buffer::{GeometryBuffer, Mixed};
use super::picture_table::PictureTable;
use super::row_table::{LANES, RowTable};
use crate::emulator::Slide;
use crate::pattern::Axis;
use crate::simd::widest;

/// A slide prepared for averaging.
pub(super) enum Table {
    /// One level, relative to full white.
    Uniform(f32),
    /// Levels along one axis.
    Row(Axis, RowTable),
    /// Levels of each slide pixel.
    Picture(PictureTable),
}

impl Table {
    /// Prepares a slide whose full level is 2^bits - 1.
    pub(super) fn new(slide: &Slide, bits: u32) -> Self {
        let scale = 1.0 / ((1u32 << bits) - 1) as f32;
        match slide {
            Slide::Uniform(level) => Self::Uniform(f32::from(*level) * scale),
            Slide::Row(axis, levels) => Self::Row(*axis, RowTable::new(levels, scale)),
            Slide::Picture {
                width,
                height,
                levels,
            } => Self::Picture(PictureTable::new(
                *width as usize,
                *height as usize,
                levels,
                scale,
            )),
        }
    }

    /// Memory that the table takes, in bytes.
    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::Uniform(_) => 0,
            Self::Row(_, row) => row.bytes(),
            Self::Picture(picture) => picture.bytes(),
        }
    }
}

/// Mean electrons of the pixels from `first` on, mixed pixels excepted: exposure time times ambient
/// light plus the slide's.
///
/// `seconds` is the exposure; `light` the projector's light relative to full, 0 when it is off.
pub(super) fn run(
    map: &GeometryBuffer,
    table: &Table,
    seconds: f32,
    light: f32,
    first: usize,
    electrons: &mut [f32],
) {
    match table {
        Table::Uniform(level) => uniform(map, *level, [seconds, light], first, electrons),
        Table::Row(axis, row) => {
            let (x, slope) = match axis {
                Axis::X => (&map.x, &map.x_slope),
                Axis::Y => (&map.y, &map.y_slope),
            };
            along_row(map, row, (x, slope), [seconds, light], first, electrons);
        }
        Table::Picture(picture) => {
            for (k, e) in electrons.iter_mut().enumerate() {
                let i = first + k;
                let lit = map.projected[i];
                let level = if lit > 0.0 {
                    picture.average(map.x[i], map.y[i], map.x_slope[i], map.y_slope[i])
                } else {
                    0.0
                };
                *e = seconds * (map.ambient[i] + light * lit * level);
            }
        }
    }
}

/// Mean electrons of a mixed pixel.
pub(super) fn mixed(pixel: &Mixed, table: &Table, seconds: f32, light: f32) -> f32 {
    let levels: [f32; 16] = match table {
        Table::Uniform(level) => [*level; 16],
        Table::Row(Axis::X, row) => row.average_mixed(&pixel.x, &pixel.x_slope),
        Table::Row(Axis::Y, row) => row.average_mixed(&pixel.y, &pixel.y_slope),
        Table::Picture(picture) => std::array::from_fn(|k| {
            picture.average(pixel.x[k], pixel.y[k], pixel.x_slope[k], pixel.y_slope[k])
        }),
    };
    let sum: f32 = levels
        .iter()
        .zip(&pixel.projected)
        .map(|(l, p)| l * p)
        .sum();
    seconds * (pixel.ambient + light * sum / pixel.projected.len() as f32)
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
        // Unlit pixels come in long runs: the branch is cheaper than their lookups.
        if projected.iter().all(|&p| p == 0.0) {
            continue;
        }
        let level = match (x.try_into(), slope.try_into()) {
            (Ok(x), Ok(slope)) => row.average(x, slope),
            // The end of the image.
            _ => {
                let (mut xs, mut slopes) = ([0.0; LANES], [[0.0; 2]; LANES]);
                xs[..x.len()].copy_from_slice(x);
                slopes[..x.len()].copy_from_slice(slope);
                row.average(&xs, &slopes)
            }
        };
        for ((e, p), level) in e.iter_mut().zip(projected).zip(level) {
            *e += light * p * level;
        }
    }
}
