//! Compares each frame with all the others, one part of the image at a time.
//!
//! In all frames that vary along an axis, a pixel's value is one offset plus one contrast times the
//! patterns' level at one coordinate, see `explained`. A frame that was dark, underexposed, torn or
//! of another pattern leaves a large misfit, most of which disappears if the frame is left out.
//! Defocus, response curves and other light also leave a misfit, but no single frame accounts for
//! most of it. A torn frame is wrong only below its tear, hence the parts.
//!
//! Pixels on a stripe edge see both sides, which leaves a misfit that leaving out another frame
//! does not remove. A frame is therefore reported only if its misfit remains when pixels near its
//! own stripe edges are excluded.
//!
//! The faulty frame cannot always be identified: in a Gray code, leaving out another bit may
//! explain as much.

use super::explained::Levels;
use super::grid::{Grid, Line, spread};
use phasmid_decode::AxisPlan;
use phasmid_pattern::{Axis, Manifest};
use rayon::prelude::*;

/// Parts, from the top of the image to its bottom.
const BANDS: usize = 6;
/// Pixels that are looked at in each, at most,
const PIXELS: usize = 64;
/// and at least.
const LEAST_PIXELS: usize = 12;
/// Without one frame less than this part of the misfit has to be left.
const DISTINCT: f64 = 0.4;
/// The same for one of three phase steps: contrast lost to blur is misfit, and the two other steps
/// fit a fringe of any contrast about as well.
const DISTINCT_OF_THREE: f64 = 0.15;

/// Returns an error if the frames fit distinctly better in any part of the image when one of them
/// is left out. Their patterns vary `along` an axis of the image.
pub(super) fn check(
    manifest: &Manifest,
    axis: &AxisPlan,
    along: Axis,
    grid: &Grid,
) -> Result<(), String> {
    let levels = Levels::new(manifest, axis, grid);
    let n = manifest.frame.len();
    let all: Vec<Option<usize>> = (0..n).map(Some).collect();
    let bad = bands(grid, along).into_par_iter().filter_map(|pixels| {
        let of_all = levels.fit(&all, &pixels, f64::INFINITY, false)?;
        if !of_all.is_doubtful() {
            return None;
        }
        let most = |lacking: usize| {
            let mut sets = axis.sets.iter();
            let of_three = sets.any(|set| set.frames.len() == 3 && set.frames.contains(&lacking));
            of_all.misfit
                * if of_three {
                    DISTINCT_OF_THREE
                } else {
                    DISTINCT
                }
        };
        // Those that leave much first: most lists leave as much and need not be heard out.
        let mut order: Vec<(f64, &[f32])> = of_all.each.iter().copied().zip(pixels).collect();
        order.sort_by(|a, b| b.0.total_cmp(&a.0));
        let pixels: Vec<&[f32]> = order.into_iter().map(|(_, pixel)| pixel).collect();
        let without = |lacking: usize| {
            let mut shows = all.clone();
            shows[lacking] = None;
            let without = levels.fit(&shows, &pixels, most(lacking), false)?;
            Some((lacking, without.misfit))
        };
        let found = (0..n).filter_map(without);
        found
            .filter(|(frame, _)| {
                let away = levels.away_from_edges(&all, *frame, &pixels);
                if away.len() < LEAST_PIXELS {
                    return false;
                }
                let mut shows = all.clone();
                let asked = levels.fit(&shows, &away, f64::INFINITY, false);
                shows[*frame] = None;
                asked.is_some_and(|asked| {
                    let most = most(*frame) / of_all.misfit * asked.misfit;
                    asked.is_doubtful() && levels.fit(&shows, &away, most, false).is_some()
                })
            })
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(frame, _)| frame)
    });
    match bad.min() {
        Some(frame) => Err(format!(
            "one of them does not show its pattern; without frame {frame} they fit best"
        )),
        None => Ok(()),
    }
}

/// Pixels that vary, by the part of the image that they lie in.
fn bands(grid: &Grid, along: Axis) -> Vec<Vec<&[f32]>> {
    let mut bands: Vec<Vec<&[f32]>> = vec![Vec::new(); BANDS];
    let count = grid.lines.len();
    for (n, line) in grid.lines.iter().enumerate() {
        for (i, pixel) in varying(line) {
            let band = match along {
                Axis::X => n * BANDS / count,
                Axis::Y => i * BANDS / line.len(),
            };
            bands[band].push(pixel);
        }
    }
    for band in &mut bands {
        *band = spread(band, PIXELS);
    }
    bands.retain(|band| band.len() >= LEAST_PIXELS);
    bands
}

fn varying(line: &Line) -> impl Iterator<Item = (usize, &[f32])> {
    let indices = (0..line.len()).filter(|i| line.varies[*i]);
    indices.map(|i| (i, line.pixel(i)))
}
