//! The projector's coordinates at a board's points, from the decoded phase around each.
//!
//! The map from camera pixels to projector pixels on a plane is a homography and what two lenses
//! bend of it, so one smooth map (`Smooth`) predicts a whole pose to a fraction of a pixel. What is left is fitted
//! about each point by a plane in both coordinates, each axis by itself, weighted by the decoder's
//! standard deviations and trimmed of what does not fit. Three things matter for what it is worth:
//!
//! - A pixel that the outline of a dot or an edge between squares crosses is lit unevenly, and its
//!   phase is that of its brighter part. Such pixels are left out, with a margin for blur. Ink
//!   itself is dark, its coordinates are known badly, and count for as much.
//! - A point's fit takes the pixels of its own cell of the board only (half a pitch to each side), so
//!   that no pixel counts for two points and the errors of different points are independent.
//! - The decoder smooths nothing, so neighbouring pixels' noise is independent, and the
//!   covariance is that of weighted least squares. What the projector's held pixels leave in the phase (some 0.01 px, see
//!   `tests/host/accuracy.rs`) alternates from pixel to pixel and nearly averages out.

mod axis;
mod cell;
mod unread;

pub use unread::{Unread, unread};

use super::smooth::Smooth;
use super::{Lit, Seen};
use axis::{AxisFit, PIXELS};
use cell::{Cells, Sample};
use glam::{DMat2, DVec2};
use phasmid_decode::Decoded;
use phasmid_geometry::Board;
use rayon::prelude::*;
use std::sync::Arc;

/// Degree of the map from board to camera: lenses bend a board's lines by cubics first.
const BOARD_DEGREE: usize = 3;
/// Degree of the map from camera to projector, two lenses one after the other.
const LIGHT_DEGREE: usize = 5;
/// Pixels that the map from camera to projector is fitted to.
const LIGHT_PIXELS: usize = 8000;

/// The projector's coordinates about one point of a board.
#[derive(Debug, Clone, PartialEq)]
pub struct LocalFit {
    light: Arc<Smooth>,
    axes: [AxisFit; 2],
}

impl LocalFit {
    /// What the projector shows at a camera pixel near the point, in pixels.
    pub fn at(&self, camera_px: DVec2) -> Lit {
        let [x, y] = self.axes.each_ref().map(|axis| axis.at(camera_px));
        let rest = DMat2::from_cols(x.slope, y.slope).transpose();
        Lit {
            px: self.light.at(camera_px) + DVec2::new(x.value, y.value),
            slope: self.light.slope(camera_px) + rest,
            covariance: DMat2::from_diagonal(DVec2::new(x.variance, y.variance)),
        }
    }

    /// Pixels that were used for the projector's columns and rows.
    pub fn pixels(&self) -> [usize; 2] {
        self.axes.each_ref().map(|axis| axis.pixels)
    }
}

/// Fits about every point that was seen, in their order; a reason where the projector lit too little of
/// a point's cell, or one side of it only, and for all where the sequence does not resolve both axes.
pub fn local_fits(
    board: &Board,
    seen: &[Seen],
    decoded: &Decoded,
) -> Vec<Result<LocalFit, Unread>> {
    fits(board, seen, decoded).unwrap_or_else(|| vec![Err(Unread::Unresolved); seen.len()])
}

fn fits(board: &Board, seen: &[Seen], decoded: &Decoded) -> Option<Vec<Result<LocalFit, Unread>>> {
    let pairs: Vec<_> = seen.iter().map(|s| (board.point(s.index), s.px)).collect();
    let camera = Smooth::fit(&pairs, BOARD_DEGREE)?;
    let cells = Cells::new(board, &camera, decoded)?;
    let samples: Vec<Vec<Sample>> = seen.par_iter().map(|s| cells.samples(s)).collect();
    let Some(light) = light(&samples).map(Arc::new) else {
        // Pixels there may be, but of no plane.
        let why = |s: &Vec<Sample>| match s.len() {
            0..PIXELS => Unread::FewPixels,
            _ => Unread::Scattered,
        };
        return Some(samples.iter().map(|s| Err(why(s))).collect());
    };
    let fit = |(seen, samples): (&Seen, &Vec<Sample>)| {
        let left = |axis: usize| AxisFit::new(seen.px, samples, &light, axis);
        Ok(LocalFit {
            axes: [left(0)?, left(1)?],
            light: Arc::clone(&light),
        })
    };
    Some(seen.par_iter().zip(&samples).map(fit).collect())
}

/// The map from camera to projector, fitted to some of all pixels.
fn light(samples: &[Vec<Sample>]) -> Option<Smooth> {
    let count: usize = samples.iter().map(Vec::len).sum();
    // Neither a multiple of a row's length nor all of one cell.
    let stride = count.div_ceil(LIGHT_PIXELS).max(1);
    let pairs: Vec<_> = samples
        .iter()
        .flatten()
        .filter(|s| !s.ink)
        .step_by(stride)
        .map(|s| (s.at, DVec2::from(s.value)))
        .collect();
    Smooth::fit(&pairs, LIGHT_DEGREE)
}

#[cfg(test)]
pub(crate) mod case;
#[cfg(test)]
mod tests;
