//! A board of dots found in a picture.
//!
//! Dark blobs make grids (`lattice`); the large ones among a grid's dots tell which way round it is
//! (`label`); an area model of each dot (`fit`) gives its centroid and outline, to a hundredth of a
//! pixel and better; dots that were missed are looked for where they should be (`complete`); and what
//! does not look like the board that was said is refused (`judge`).

mod blobs;
mod complete;
mod coverage;
mod ellipse;
mod fit;
mod judge;
mod known;
mod label;
mod lattice;
mod measure;
mod step;
#[cfg(test)]
mod tests;

use crate::board::{NotFound, Picture, Seen};
use blobs::Blob;
use known::{Dot, Dots};
use label::Labels;
use lattice::Grid;
use phasmid_geometry::Board;
use std::collections::BTreeMap;

/// Sides in pixels of the square that a pixel is compared with, and the part of its mean below
/// which a pixel is dark, in the order of trial. A square suits grids whose pitch is a sixth of it
/// up to two thirds.
const TRIALS: [(usize, f64); 7] = [
    (48, 0.7),
    (96, 0.7),
    (24, 0.75),
    (48, 0.85),
    (192, 0.7),
    (384, 0.7),
    (768, 0.7),
];
/// Dots of a grid that is looked at, and how many grids are.
const LEAST: usize = 9;
const GRIDS: usize = 6;
/// Points of a board along a side.
const SIDES: std::ops::RangeInclusive<u32> = 5..=199;

/// The board's dots in a picture, row by row: those that are whole and measured well.
///
/// `px` of each is the centroid of its image's area, free of the light's slope; its covariance is of
/// the picture's noise, enlarged where the residuals are larger than it says.
///
/// # Errors
/// No board of dots, one that cannot be told which way round it is, a mirrored one, another one.
pub fn find(board: &Board, picture: &Picture) -> Result<Vec<Seen>, NotFound> {
    let [columns, rows] = board.grid();
    let nothing = |found: String| NotFound::Nothing {
        found,
        wanted: format!("a grid of {columns} x {rows} dark dots, or a part with its markers"),
    };
    let Board::Dots { .. } = board else {
        return Err(nothing("a search for dots".into()));
    };
    let pixels = picture.width.checked_mul(picture.height);
    if pixels != Some(picture.level.len()) || pixels != Some(picture.variance.len()) {
        return Err(nothing("a picture whose pixels are not all there".into()));
    }
    if !(SIDES.contains(&columns) && SIDES.contains(&rows)) {
        return Err(nothing(format!(
            "a search for a board beyond {} to {} dots a side",
            SIDES.start(),
            SIDES.end()
        )));
    }
    let (mut most_blobs, mut best) = (0, None::<(usize, NotFound)>);
    let mut largest = 0;
    for (side, part) in TRIALS {
        if side / 2 > picture.width.max(picture.height) {
            continue;
        }
        let blobs = blobs::find(picture, side, part);
        most_blobs = most_blobs.max(blobs.len());
        if blobs.len() < LEAST {
            continue;
        }
        let mut labelled = Vec::new();
        for grid in lattice::grids(&blobs).into_iter().take(GRIDS) {
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
            [(grid, labels)] => return seen(board, picture, &blobs, grid, labels),
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
            "{most_blobs} dark blobs that make no grid"
        ))),
    }
}

/// Measures the dots of a grid that has been labelled.
fn seen(
    board: &Board,
    picture: &Picture,
    blobs: &[Blob],
    grid: &Grid,
    labels: &Labels,
) -> Result<Vec<Seen>, NotFound> {
    let mut known = BTreeMap::new();
    let mut beyond = Vec::new();
    for (&cell, &k) in grid {
        let cell = labels.index(cell);
        if known::index(board, cell).is_none() {
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
    let measure = measure::Measure::new(picture, &mut dots);
    let judge = judge::Judge::new(&measure, &dots);
    judge::proportions(&dots)?;
    judge.sift(&mut dots);
    complete::complete(&measure, &judge, &mut dots);
    judge::extent(&dots, &judge)?;
    // Blur carries light along its slope: an image blurred by variance s under light whose relative
    // slope is g lies s g from where it would be under even light. The pixel is a blur too.
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

/// Whether rows or columns of dots go on beyond the board's: at least half of one does. Less is
/// clutter.
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
