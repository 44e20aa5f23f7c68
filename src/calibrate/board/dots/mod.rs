//! Finds a dot board in an image and measures its dots.
//!
//! In this order:
//!
//! - `find`: finds dark blobs, the candidate dots, and their ellipses.
//! - `lattice`: arranges blobs into grids; holds the dots found so far and predicts further dots.
//! - `label`: identifies the large dots (markers) of a grid, which give the board's orientation.
//! - `measure`: estimates the image's blur and contrast, then fits every dot. `fit` fits the area
//!   model of one dot. The fit gives the dot's centroid and outline to a hundredth of a pixel or
//!   better. `coverage` computes the area of each pixel that a dot covers.
//! - `judge`: searches for missed dots; rejects unreliable dots, and boards that do not match the
//!   specified one.

mod coverage;
mod find;
mod fit;
mod judge;
mod label;
mod lattice;
mod measure;
#[cfg(test)]
mod tests;

use crate::board::sighting::check;
use crate::board::{BoardImage, NotFound, Seen};
use find::Blob;
use label::Labels;
use lattice::{Dot, Dots, Grid};
use phasmid_core::Stop;
use phasmid_geometry::Board;
use std::collections::BTreeMap;

/// Dark-pixel thresholds, in the order of trial: side in pixels of the square around a pixel, and
/// fraction of the square's mean below which the pixel is dark. A square suits grids whose pitch is
/// between a sixth and two thirds of the square's side.
const TRIALS: [(usize, f64); 7] = [
    (48, 0.7),
    (96, 0.7),
    (24, 0.75),
    (48, 0.85),
    (192, 0.7),
    (384, 0.7),
    (768, 0.7),
];
/// Minimum number of blobs for a grid search, and maximum number of grids examined, largest first.
const LEAST: usize = 9;
const GRIDS: usize = 6;
/// Allowed number of dots along a side of the board.
const SIDES: std::ops::RangeInclusive<u32> = 5..=199;

/// Finds the board's dots in an image and returns the complete, well measured dots, row by row.
///
/// Each `px` is the centroid of the imaged dot's area, corrected for the gradient of the light. Its
/// covariance follows from the image noise, scaled up where the fits' residuals exceed that noise.
///
/// # Errors
/// Returns an error if no dot board is found, its orientation is ambiguous, the image is mirrored,
/// or the board differs from the specified one.
pub fn find(board: &Board, image: &BoardImage) -> Result<Vec<Seen>, NotFound> {
    search(board, image, &Stop::default())
}

/// Like [`find`], but returns [`NotFound::Interrupted`] soon after a stop is requested.
pub(crate) fn search(
    board: &Board,
    image: &BoardImage,
    stop: &Stop,
) -> Result<Vec<Seen>, NotFound> {
    let [columns, rows] = board.grid();
    let nothing = |found: String| NotFound::Nothing {
        found,
        wanted: format!("a grid of {columns} x {rows} dark dots, or a part with its markers"),
    };
    let Board::Dots { .. } = board else {
        return Err(nothing("a board without dots".into()));
    };
    let pixels = image.width.checked_mul(image.height);
    if pixels != Some(image.level.len()) || pixels != Some(image.variance.len()) {
        return Err(nothing("an image with missing pixels".into()));
    }
    if !(SIDES.contains(&columns) && SIDES.contains(&rows)) {
        return Err(nothing(format!(
            "a board outside {} to {} dots a side",
            SIDES.start(),
            SIDES.end()
        )));
    }
    let (mut most_blobs, mut best) = (0, None::<(usize, NotFound)>);
    let mut largest = 0;
    for (side, part) in TRIALS {
        if side / 2 > image.width.max(image.height) {
            continue;
        }
        check(stop)?;
        let blobs = find::find(image, side, part);
        most_blobs = most_blobs.max(blobs.len());
        if blobs.len() < LEAST {
            continue;
        }
        let mut labelled = Vec::new();
        for grid in lattice::grids(&blobs).into_iter().take(GRIDS) {
            check(stop)?;
            largest = largest.max(grid.len());
            match label::label(board, &blobs, &grid) {
                Ok(labels) => labelled.push((grid, labels)),
                Err(why) => {
                    if best.as_ref().is_none_or(|(size, _)| grid.len() > *size) {
                        best = Some((grid.len(), why));
                    }
                }
            }
        }
        match labelled.as_slice() {
            [] => {}
            [(grid, labels)] => return seen(board, image, &blobs, grid, labels),
            several => {
                return Err(NotFound::Ambiguous {
                    found: format!("{} boards", several.len()),
                    wanted: "one".into(),
                });
            }
        }
    }
    match best {
        Some((_, why)) => Err(why),
        None => Err(nothing(format!(
            "{most_blobs} dark blobs that do not form a grid"
        ))),
    }
}

/// Measures the dots of a labelled grid.
fn seen(
    board: &Board,
    image: &BoardImage,
    blobs: &[Blob],
    grid: &Grid,
    labels: &Labels,
) -> Result<Vec<Seen>, NotFound> {
    let mut known = BTreeMap::new();
    let mut beyond = Vec::new();
    for (&cell, &k) in grid {
        let cell = labels.index(cell);
        if lattice::index(board, cell).is_none() {
            beyond.push(cell);
        }
        let dot = Dot {
            start: blobs[k].ellipse,
            fit: None,
        };
        known.insert(cell, dot);
    }
    larger(board, &known, &beyond)?;
    for cell in beyond {
        known.remove(&cell);
    }
    let mut dots = Dots { board, known };
    let measure = measure::Measure::new(image, &mut dots);
    let judge = judge::Judge::new(&measure, &dots);
    judge::proportions(&dots)?;
    judge.sift(&mut dots);
    judge::complete(&measure, &judge, &mut dots);
    judge::extent(&dots, &judge)?;
    // Blur under a light gradient shifts the image of a dot: with blur variance s and relative
    // light gradient g, the dot appears at a distance of s g from its position under even light.
    // The pixel's box adds 1/12 to s.
    let blur = measure.blur + 1.0 / 12.0;
    let mut seen: Vec<Seen> = dots
        .known
        .iter()
        .filter_map(|(&cell, dot)| {
            let fit = dot.fit.as_ref()?;
            Some(Seen {
                index: dots.index(cell)?,
                px: fit.model.ellipse.centre + fit.slope * blur,
                covariance: fit.covariance * judge.chi2,
                outline: fit.model.ellipse.shape,
            })
        })
        .collect();
    seen.sort_by_key(|s| [s.index[1], s.index[0]]);
    Ok(seen)
}

/// Returns an error if the grid continues beyond the board, that is, if a row or column just
/// outside the board is at least half full. Fewer dots are taken as clutter.
fn larger(
    board: &Board,
    known: &BTreeMap<lattice::Cell, Dot>,
    beyond: &[lattice::Cell],
) -> Result<(), NotFound> {
    let [columns, rows] = board.grid();
    let sides = [columns as i32, rows as i32];
    let span = |axis: usize| {
        let all = || known.keys().map(|cell| cell[axis]);
        (all().max().unwrap_or(0) - all().min().unwrap_or(0) + 1) as usize
    };
    let full = |axis: usize| {
        let mut lines: BTreeMap<i32, usize> = BTreeMap::new();
        for cell in beyond {
            if !(0..sides[axis]).contains(&cell[axis]) {
                *lines.entry(cell[axis]).or_default() += 1;
            }
        }
        let most = lines.values().copied().max().unwrap_or(0);
        most >= 4 && 2 * most >= span(1 - axis)
    };
    if !full(0) && !full(1) {
        return Ok(());
    }
    Err(NotFound::WrongBoard {
        found: format!(
            "a grid of {} x {} dots, {} of them beyond the board's edges",
            span(0),
            span(1),
            beyond.len()
        ),
        wanted: format!("{columns} x {rows} dots"),
    })
}
