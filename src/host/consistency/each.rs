//! Each frame against all the others, one part of the image at a time.
//!
//! As `explained` has it, all frames that vary along an axis are one offset and one contrast times what the
//! patterns have at one coordinate. A frame that was dark, lit too short, of another pattern or torn
//! leaves much unexplained that the others without it do not. Defocus, response curves and light
//! from elsewhere leave something too, but no single frame's lack makes most of that go. A torn
//! frame is wrong below its tear only, hence the parts. Pixels at the edge of a stripe see some of both
//! sides, of which another frame's lack takes nothing; on a board of few bright squares many of a part's
//! pixels can be such, so what a frame leaves has to be left away from its edges as well. Which frame it is cannot always be told: of
//! a Gray code, the lack of another bit may explain as much.

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
/// And less than this without one of three steps: what blur takes of a fringe's contrast is misfit, and two
/// steps that are left fit a fringe of any contrast about as well.
const DISTINCT_OF_THREE: f64 = 0.15;

/// Whether the frames without one of them fit distinctly better anywhere; their patterns vary `along` an
/// axis of the image.
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
