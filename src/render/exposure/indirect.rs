//! Exposure pass of indirect light: averages a pattern over the ray hits of each gather point and
//! interpolates the result over the pixels.

use super::image_table::ImageTable;
use super::indirect_map::{BLOCK, InterreflectionMap};
use super::pass::Table;
use super::row_table::RowTable;
use phasmid_core::simd::widest;
use phasmid_pattern::Axis;
use rayon::prelude::*;

/// Number of gather points per parallel task.
const TASK: usize = 256;

/// Indirect light of a pattern at the gather points.
pub(crate) struct Indirect {
    /// Irradiance of each gather point in W/m^2; empty without indirect light.
    points: Vec<f32>,
}

impl Indirect {
    /// Averages a pattern that the projector shows at full light.
    pub(crate) fn new(interreflection: &InterreflectionMap, table: &Table) -> Self {
        let mut points = Vec::new();
        if !interreflection.weight.is_empty() {
            points.resize(interreflection.padded(), 0.0);
            points[..interreflection.ends.len()]
                .par_chunks_mut(TASK)
                .enumerate()
                .for_each(|(i, points)| average(interreflection, table, i * TASK, points));
        }
        Self { points }
    }

    /// Adds the indirect light to the electrons of the pixels that start at index `first`. `seconds`
    /// is the exposure times the projector's light relative to full.
    pub(crate) fn add(
        &self,
        interreflection: &InterreflectionMap,
        first: usize,
        seconds: f32,
        electrons: &mut [f32],
    ) {
        if !self.points.is_empty() {
            spread(interreflection, &self.points, first, seconds, electrons);
        }
    }
}

/// Computes the irradiance of the gather points that start at index `first`.
fn average(interreflection: &InterreflectionMap, table: &Table, first: usize, points: &mut [f32]) {
    match table {
        Table::Uniform(level) => {
            for (point, white) in points.iter_mut().zip(&interreflection.white[first..]) {
                *point = level * white;
            }
        }
        Table::Row(Axis::X, row, _) => {
            along_row(
                interreflection,
                row,
                (&interreflection.x, &interreflection.x_slope),
                first,
                points,
            );
        }
        Table::Row(Axis::Y, row, _) => {
            along_row(
                interreflection,
                row,
                (&interreflection.y, &interreflection.y_slope),
                first,
                points,
            );
        }
        Table::Image(image) => {
            for (k, point) in points.iter_mut().enumerate() {
                *point = blocks(interreflection, first + k)
                    .map(|block| of_image(interreflection, image, block))
                    .sum();
            }
        }
    }
}

/// Returns the indices of a gather point's blocks of rays.
#[inline(always)]
fn blocks(interreflection: &InterreflectionMap, point: usize) -> std::ops::Range<usize> {
    let end = |point: usize| interreflection.ends[point] as usize;
    point.checked_sub(1).map_or(0, end)..end(point)
}

fn of_image(interreflection: &InterreflectionMap, image: &ImageTable, block: usize) -> f32 {
    (0..BLOCK)
        .filter(|&lane| interreflection.weight[block][lane] > 0.0)
        .map(|lane| {
            let at = [
                interreflection.x[block][lane],
                interreflection.y[block][lane],
            ];
            let slopes = (
                interreflection.x_slope[block][lane],
                interreflection.y_slope[block][lane],
            );
            interreflection.weight[block][lane] * image.average(at, slopes.0, slopes.1, [0.0; 2])
        })
        .sum()
}

widest! {
    fn along_row(
        interreflection: &InterreflectionMap, row: &RowTable, rays: (&[[f32; BLOCK]], &[[[f32; 2]; BLOCK]]),
        first: usize, points: &mut [f32],
    ) => along_row_body
}
widest! {
    fn spread(
        interreflection: &InterreflectionMap, points: &[f32], first: usize, seconds: f32, electrons: &mut [f32],
    ) => spread_body
}

#[inline(always)]
fn along_row_body(
    interreflection: &InterreflectionMap,
    row: &RowTable,
    (x, slope): (&[[f32; BLOCK]], &[[[f32; 2]; BLOCK]]),
    first: usize,
    points: &mut [f32],
) {
    for (k, point) in points.iter_mut().enumerate() {
        let mut sums = [0.0f32; BLOCK];
        for block in blocks(interreflection, first + k) {
            let level = row.average(&x[block], &slope[block]);
            let weight = &interreflection.weight[block];
            for lane in 0..BLOCK {
                sums[lane] += weight[lane] * level[lane];
            }
        }
        let [a, b, c, d, e, f, g, h] = sums;
        *point = ((a + e) + (b + f)) + ((c + g) + (d + h));
    }
}

#[inline(always)]
fn spread_body(
    interreflection: &InterreflectionMap,
    points: &[f32],
    first: usize,
    seconds: f32,
    electrons: &mut [f32],
) {
    for (k, e) in electrons.iter_mut().enumerate() {
        *e += seconds * interreflection.at(first + k, points);
    }
}
