//! Error due to held projector pixels: corrected, and stated where it remains.
//!
//! Where a camera pixel spans less than a few projector pixels, it sees the steps between them: the
//! decoded coordinate is periodically off. The error is the same in every frame and period, so no
//! residual of the decoding shows it. `curve` models the error, `footprint` measures width and blur of
//! the footprints from the map itself, and `posterior` estimates the true coordinate for each decoded
//! one. `smooth` also uses the surface around a pixel.

mod curve;
mod footprint;
mod posterior;
mod smooth;

use super::maps::AxisMap;
use curve::Footprint;
use footprint::{CELL, Grid, Lines};
use phasmid_core::simd::widest;
use phasmid_core::statistics::finite_median;
use phasmid_pattern::Axis;
use posterior::NEGLIGIBLE;
pub use posterior::Table;
use rayon::prelude::*;

/// How the decoder treats the error due to held projector pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Held {
    /// Neither states nor corrects the error.
    Off,
    /// States the error.
    State,
    /// Corrects the error pixel by pixel: the result is the mean of the true coordinates that agree
    /// with the decoded one. States the remaining error.
    #[default]
    Correct,
    /// Corrects the error with the smooth surface through the pixels of a line as prior knowledge.
    /// Reduces the amplitude of ripples of 6 to 12 pixels by up to half where a pixel spans less than a
    /// projector pixel.
    Smooth,
}

/// Side, in pixels, of the coarse cells that decide whether the error matters at all.
const COARSE: usize = 32;
/// Fraction of the noise above which the error is worth a note.
const LARGE: f32 = 0.5;
/// Approximate number of pixels sampled for a note.
const SAMPLES: usize = 4000;
/// Limits of a negligible error, as pairs: a fraction of the noise, and the fraction of the image in
/// which the error may exceed it. Even where blur removes all error, the measured blur scatters.
const FEW: [[f32; 2]; 2] = [[NEGLIGIBLE, 0.1], [3.0 * NEGLIGIBLE, 0.01]];

/// The footprints of a map's pixels on the projector's.
#[derive(Debug)]
pub(super) struct Footprints<'a> {
    table: &'a Table,
    grid: Grid,
    /// Maximum error of linear extrapolations due to held pixels in each cell, in projector pixels.
    bend: Vec<f32>,
    /// Median width of the footprints in projector pixels.
    width: f32,
}

impl<'a> Footprints<'a> {
    /// Measures the footprints of a map, whose neighbouring pixels are `apart` pixel widths apart.
    /// Returns `None` if the error due to held projector pixels is negligible, or if no part of the
    /// surface is smooth.
    pub fn new(map: &AxisMap, size: [usize; 2], apart: f32, table: &'a Table) -> Option<Self> {
        let lines = Lines::of(map, size, apart);
        if is_negligible(lines, table) {
            return None;
        }
        let mut grid = Grid::new(lines, CELL, table);
        let median = grid.median()?;
        // Pixels without a smooth surface around them get the median footprint.
        for cell in &mut grid.cells {
            cell.get_or_insert(median);
        }
        let bend = |cell: &Option<Footprint>| table.of(cell.unwrap_or(median), |curve| curve.bend);
        let bend = grid.cells.par_iter().map(bend).collect();
        Some(Self {
            table,
            grid,
            bend,
            width: median.width,
        })
    }

    /// Writes the maximum error of linear extrapolations in row `v` due to held pixels, in projector
    /// pixels.
    pub(super) fn allow(&self, v: usize, row: &mut [f32]) {
        let first = v / CELL * self.grid.columns;
        let bend = &self.bend[first..first + self.grid.columns];
        for (pixels, bend) in row.chunks_mut(CELL).zip(bend) {
            pixels.fill(*bend);
        }
    }

    /// Returns a note if the error that remains in a corrected map is large compared with the noise.
    pub(super) fn note(&self, axis: Axis, map: &AxisMap) -> Option<String> {
        // Odd, so that the samples do not all fall into one image column.
        let stride = (map.sigma.len() / SAMPLES) | 1;
        let sampled = |all: &[f32]| finite_median(all.iter().copied().step_by(stride));
        let (noise, held) = (sampled(&map.sigma)?, sampled(&map.sampling)?);
        (held > LARGE * noise).then(|| {
            format!(
                "axis {axis}: held projector pixels and the rounding of their levels to 8 bits leave an \
                 error of {held:.3} px beside {noise:.3} px of noise (medians); a camera pixel spans \
                 {:.2} projector pixels",
                self.width
            )
        })
    }

    /// Corrects the coordinates of the map and writes its `sampling`.
    pub(super) fn correct(&self, map: &mut AxisMap, width: usize, how: Held) {
        map.sampling.resize(map.coordinate.len(), 0.0);
        map.coordinate
            .par_chunks_mut(CELL * width)
            .zip(map.sigma.par_chunks_mut(CELL * width))
            .zip(map.sampling.par_chunks_mut(CELL * width))
            .zip(self.grid.cells.par_chunks(self.grid.columns))
            .zip(self.grid.even.par_chunks(self.grid.columns))
            .for_each(|((((coordinate, sigma), sampling), cells), even)| {
                let band = Band {
                    coordinate,
                    sigma,
                    sampling,
                    width,
                };
                correct_band(band, cells, even, self.table, how);
            });
        if how == Held::Smooth {
            smooth::correct(&self.grid, self.table, map, width);
        }
    }
}

/// Returns true if the error is below a fraction of the noise in nearly all of a map.
fn is_negligible(lines: Lines<'_>, table: &Table) -> bool {
    let grid = Grid::new(lines, COARSE, table);
    let [width, height] = lines.size;
    let (mut known, mut large) = (0, [0; FEW.len()]);
    for (i, cell) in grid.cells.iter().enumerate() {
        let Some(footprint) = *cell else { continue };
        let [u, v] = [i % grid.columns, i / grid.columns].map(|k| k * COARSE + COARSE / 2);
        let sigma = lines.sigma[v.min(height - 1) * width + u.min(width - 1)];
        known += 1;
        // Where sigma is NaN the comparison is false, and the cell does not count.
        let rms = table.of(footprint, |curve| curve.rms);
        for (large, [most, _]) in large.iter_mut().zip(FEW) {
            *large += u32::from(rms > most * sigma);
        }
    }
    let is_few = |(large, [_, share]): (u32, [f32; 2])| large as f32 <= share * known as f32;
    known > 0 && large.into_iter().zip(FEW).all(is_few)
}

/// A band of rows of a map.
struct Band<'a> {
    coordinate: &'a mut [f32],
    sigma: &'a mut [f32],
    sampling: &'a mut [f32],
    /// Columns.
    width: usize,
}

widest! {
    /// Corrects a band with the footprint of each of its cells.
    fn correct_band(
        band: Band<'_>,
        cells: &[Option<Footprint>],
        even: &[bool],
        table: &Table,
        how: Held,
    ) => Band::correct
}

impl Band<'_> {
    #[inline(always)]
    fn correct(self, cells: &[Option<Footprint>], even: &[bool], table: &Table, how: Held) {
        let rows = self.coordinate.len() / self.width;
        let cells = cells.iter().zip(even).enumerate();
        for (i, (footprint, even)) in cells {
            let columns = i * CELL..((i + 1) * CELL).min(self.width);
            let row = |row: usize| row * self.width + columns.start..row * self.width + columns.end;
            let (mut n, mut sum) = (0.0, 0.0);
            for sigma in (0..rows).flat_map(|v| &self.sigma[row(v)]) {
                let is_valid = !sigma.is_nan();
                n += f32::from(u8::from(is_valid));
                sum += if is_valid { *sigma } else { 0.0 };
            }
            let sigma = sum / n;
            let rms = footprint.map_or(0.0, |footprint| table.of(footprint, |curve| curve.rms));
            // Without valid pixels the noise is NaN.
            let rms = if rms > NEGLIGIBLE * sigma { rms } else { 0.0 };
            let stated = rms.hypot(table.rounding);
            // An incomplete cell lies at the edge of a surface, and its footprint may be that of
            // another surface.
            let is_whole = n == (rows * columns.len()) as f32;
            let profile = (*footprint)
                .filter(|_| rms > 0.0 && *even && is_whole && how == Held::Correct)
                .map(|footprint| table.profile(footprint, sigma));
            for at in (0..rows).map(row) {
                let (coordinate, noise) = (
                    &mut self.coordinate[at.clone()],
                    &mut self.sigma[at.clone()],
                );
                let sampling = &mut self.sampling[at];
                let Some(profile) = &profile else {
                    for (sampling, noise) in sampling.iter_mut().zip(noise) {
                        *sampling = stated + 0.0 * *noise;
                    }
                    continue;
                };
                for ((x, noise), sampling) in coordinate.iter_mut().zip(noise).zip(sampling) {
                    let estimate = profile.at(*x);
                    *x += estimate.shift;
                    *noise *= estimate.gain;
                    *sampling = estimate.beyond_noise + 0.0 * *noise;
                }
            }
        }
    }
}
