//! Projector coordinates at a board's points, from the decoded phase around each point.
//!
//! - `cell`: selects the decoded pixels around a point.
//! - `axis`: fits one projector coordinate around a point, or says why it cannot.
//!
//! The map from camera pixels to projector pixels on a plane is a homography plus the distortion of
//! two lenses, so one smooth map (`Smooth`) predicts a whole pose to a fraction of a pixel. The
//! residual around each point is fitted by a plane, separately for each projector axis, weighted by
//! the decoder's standard deviations and with outliers removed. Three properties determine the
//! accuracy:
//!
//! - A pixel crossed by a dot's outline or by an edge between squares is lit unevenly, and its
//!   phase is that of its brighter part. Such pixels are excluded, with a margin for blur. Pixels
//!   on ink are dark, so their coordinates are noisy and have little weight.
//! - A point's fit uses only pixels of its own cell of the board (half a pitch to each side). No
//!   pixel counts for two points, so the errors of different points are independent.
//! - The decoder does not smooth, so the noise of neighbouring pixels is independent and the
//!   covariance is that of weighted least squares. The phase error caused by the projector's
//!   discrete pixels (about 0.01 px, see `tests/host/accuracy.rs`) alternates from pixel to pixel
//!   and nearly averages out.

mod axis;
mod cell;

pub use axis::Unread;

use super::smooth::Smooth;
use super::{Lit, Seen};
use axis::{AxisFit, PIXELS};
use cell::{Cells, Sample};
use glam::{DMat2, DVec2};
use phasmid_decode::Decoded;
use phasmid_geometry::Board;
use rayon::prelude::*;
use std::sync::Arc;

/// Degree of the map from board to camera: the leading term of lens distortion is cubic.
const BOARD_DEGREE: usize = 3;
/// Degree of the map from camera to projector, which combines two lenses.
const LIGHT_DEGREE: usize = 5;
/// Approximate maximum number of pixels for the fit of the map from camera to projector.
const LIGHT_PIXELS: usize = 8000;

/// Fitted projector coordinates around one point of a board.
#[derive(Debug, Clone, PartialEq)]
pub struct LocalFit {
    light: Arc<Smooth>,
    axes: [AxisFit; 2],
}

impl LocalFit {
    /// Returns the projector coordinates at a camera pixel near the point, in pixels.
    pub fn at(&self, camera_px: DVec2) -> Lit {
        let [x, y] = self.axes.each_ref().map(|axis| axis.at(camera_px));
        let rest = DMat2::from_cols(x.slope, y.slope).transpose();
        Lit {
            px: self.light.at(camera_px) + DVec2::new(x.value, y.value),
            slope: self.light.slope(camera_px) + rest,
            covariance: DMat2::from_diagonal(DVec2::new(x.variance, y.variance)),
        }
    }

    /// Returns the numbers of camera pixels used for the projector's columns and rows.
    pub fn pixels(&self) -> [usize; 2] {
        self.axes.each_ref().map(|axis| axis.pixels)
    }
}

/// Fits the projector coordinates around every point in `seen` and returns the results in that
/// order.
///
/// # Errors
/// A result is an error if the decoded pixels in the point's cell are too few, one-sided or
/// inconsistent. All results are errors if the sequence does not resolve both axes, or if the
/// board's points do not determine a map.
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
        // If no map could be fitted although there are enough pixels, their coordinates are
        // scattered.
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

/// Fits the map from camera to projector to a subset of all samples on paper.
fn light(samples: &[Vec<Sample>]) -> Option<Smooth> {
    let count: usize = samples.iter().map(Vec::len).sum();
    // The stride spreads the subset over all cells.
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

/// Returns a sentence that says how many points have no coordinates, and for which reasons. Returns
/// `None` if all points have coordinates.
pub fn unread<'a>(
    fits: impl Iterator<Item = &'a Result<LocalFit, Unread>> + Clone,
) -> Option<String> {
    let mut reasons: Vec<Unread> = fits
        .clone()
        .filter_map(|f| f.as_ref().err())
        .copied()
        .collect();
    reasons.sort_unstable();
    let each: Vec<String> = reasons
        .chunk_by(|a, b| a == b)
        .map(|same| format!("{} {}", same.len(), same[0]))
        .collect();
    (!each.is_empty()).then(|| {
        format!(
            "{} of {} points have no projector coordinates: {}",
            reasons.len(),
            fits.count(),
            each.join(", ")
        )
    })
}

#[cfg(test)]
pub(crate) mod case;
#[cfg(test)]
mod tests;
