//! Error due to held projector pixels: corrected, and stated where it remains.
//!
//! Where a camera pixel is narrower than some projector pixels, it sees the steps between them: the
//! decoded coordinate is periodically off. The error is the same in every frame and period, so that no
//! residual of the decoding shows it. `curve` has its model, `footprint` measures width and blur of
//! the footprints from the map itself, and `posterior` gives the true coordinate that each decoded one
//! stands for.

mod curve;
mod footprint;
mod posterior;

use super::maps::AxisMap;
use super::output::median;
use footprint::{Footprint, Grid, Lines};
use phasmid_pattern::Axis;
pub use posterior::Table;
use rayon::prelude::*;

/// Treatment of the error due to held projector pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Held {
    /// States the error.
    State,
    /// Corrects it pixel by pixel by the mean of the true coordinates that agree with the decoded one,
    /// and states what remains.
    #[default]
    Correct,
}

/// Side of the cells in which footprint and blur are measured, in pixels.
const CELL: usize = 8;
/// The same for a first look at whether there is anything to do.
const COARSE: usize = 32;
/// An error below this fraction of the noise is left out: it adds 0.5 % to the standard deviation.
const NEGLIGIBLE: f32 = 0.1;
/// Fraction of the noise above which the error is worth a note.
const LARGE: f32 = 0.5;
/// Fraction of an image in which a larger error is left out as well.
const FEW: f32 = 0.01;

/// The footprints of a map's pixels on the projector's.
#[derive(Debug)]
pub(super) struct Footprints<'a> {
    table: &'a Table,
    grid: Grid,
    /// Footprint of pixels without a smooth surface around them.
    median: Footprint,
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
        let grid = Grid::new(lines, CELL, table);
        let median = grid.median()?;
        Some(Self {
            table,
            grid,
            median,
        })
    }

    /// Writes by how much held pixels put linear extrapolations in row `v` off at most, in projector
    /// pixels.
    pub(super) fn allow(&self, v: usize, row: &mut [f32]) {
        let first = v / CELL * self.grid.columns;
        let cells = &self.grid.cells[first..first + self.grid.columns];
        for (pixels, cell) in row.chunks_mut(CELL).zip(cells) {
            let footprint = cell.unwrap_or(self.median);
            pixels.fill(self.table.of(footprint, |curve| curve.bend));
        }
    }

    /// Says by how much the error that remains in a corrected map exceeds the noise, if it does.
    pub(super) fn note(&self, axis: Axis, map: &AxisMap) -> Option<String> {
        let [noise, held] = [&map.sigma, &map.sampling].map(|all| median(all.iter().copied()));
        let (noise, held) = (noise?, held?);
        (held > LARGE * noise).then(|| {
            format!(
                "axis {axis}: held projector pixels leave an error of {held:.3} px beside {noise:.3} px \
                 of noise (medians), because a camera pixel spans only {:.2} projector pixels",
                self.median.width
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
                let mut band = Band {
                    coordinate,
                    sigma,
                    sampling,
                };
                let rows = band.coordinate.len() / width;
                for (i, (cell, even)) in cells.iter().zip(even).enumerate() {
                    let how = if *even { how } else { Held::State };
                    let columns = i * CELL..((i + 1) * CELL).min(width);
                    let row = |row: usize| columns.clone().map(move |u| row * width + u);
                    let pixels = (0..rows).flat_map(row);
                    band.correct(pixels, cell.unwrap_or(self.median), self.table, how);
                }
            });
    }
}

/// Returns whether the error is below a fraction of the noise in nearly all of a map.
fn is_negligible(lines: Lines<'_>, table: &Table) -> bool {
    let grid = Grid::new(lines, COARSE, table);
    let [width, height] = lines.size;
    let (mut known, mut large) = (0, 0);
    for (i, cell) in grid.cells.iter().enumerate() {
        let Some(footprint) = *cell else { continue };
        let [u, v] = [i % grid.columns, i / grid.columns].map(|k| k * COARSE + COARSE / 2);
        let sigma = lines.sigma[v.min(height - 1) * width + u.min(width - 1)];
        known += 1;
        // A cell beside a hole has no noise of its own.
        large += usize::from(table.of(footprint, |c| c.rms) > NEGLIGIBLE * sigma);
    }
    known > 0 && large as f32 <= FEW * known as f32
}

/// A band of rows of a map.
struct Band<'a> {
    coordinate: &'a mut [f32],
    sigma: &'a mut [f32],
    sampling: &'a mut [f32],
}

impl Band<'_> {
    /// Corrects pixels with a common footprint.
    fn correct(
        &mut self,
        pixels: impl Iterator<Item = usize> + Clone,
        footprint: Footprint,
        table: &Table,
        how: Held,
    ) {
        let (mut n, mut sum) = (0.0, 0.0);
        for i in pixels.clone() {
            if !self.sigma[i].is_nan() {
                n += 1.0;
                sum += self.sigma[i];
            }
        }
        if n == 0.0 {
            pixels.for_each(|i| self.sampling[i] = f32::NAN);
            return;
        }
        // A surface ends here, and its footprint may be that of another.
        let how = if n < pixels.clone().count() as f32 {
            Held::State
        } else {
            how
        };
        let sigma = sum / n;
        let rms = table.of(footprint, |curve| curve.rms);
        let rms = if rms > NEGLIGIBLE * sigma { rms } else { 0.0 };
        if rms == 0.0 || how == Held::State {
            for i in pixels {
                self.sampling[i] = rms + 0.0 * self.sigma[i];
            }
            return;
        }
        let profile = table.profile(footprint, sigma);
        for i in pixels {
            let estimate = profile.at(self.coordinate[i]);
            self.coordinate[i] += estimate.shift;
            let noise = estimate.gain * sigma;
            self.sigma[i] *= estimate.gain;
            let beyond_noise = (estimate.variance - noise * noise).max(0.0).sqrt();
            self.sampling[i] = beyond_noise + 0.0 * self.sigma[i];
        }
    }
}
