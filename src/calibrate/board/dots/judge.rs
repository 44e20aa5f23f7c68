//! Judges measured dots and the board they form: rejects unreliable dots and boards that do not
//! match the specified one, and searches for missed dots where their neighbours predict them.

use super::find::Ellipse;
use super::lattice::{Cell, Dot, Dots};
use super::measure::Measure;
use crate::board::{BoardImage, NotFound};
use glam::DVec2;
use phasmid_core::statistics::finite_median;
use phasmid_geometry::Board;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Minimum fraction of the information on a dot's centre that must lie in usable pixels.
const TOLD: f64 = 0.8;
/// Maximum ratio of a fit's chi-square per degree of freedom to the median of all fits.
const WORSE: f64 = 25.0;
/// Maximum ratios, in either direction: of a dot's contrast to the median contrast; of a dot's
/// radius to the predicted radius.
const CONTRAST: f64 = 1.4;
const RADIUS: f64 = 1.2;
/// Maximum distance from the position that the neighbours predict, in pitches.
const STRAY: f64 = 0.25;
/// Minimum ratio of a dot's contrast to its standard deviation.
const STRENGTH: f64 = 10.0;
/// Maximum standard deviation of a dot's centre, in pixels.
const LEAST_SURE: f64 = 0.1;
/// Maximum ratio, in either direction, of measured to specified proportions. Printed dots differ
/// from the specification because ink spreads on paper.
const PROPORTION: f64 = 1.15;
/// Fraction of the paper's level above which a pixel counts as lit paper.
const LIT: f64 = 0.6;

/// Properties that the dots of an image share.
pub(super) struct Judge<'a> {
    image: &'a BoardImage,
    sigma: f64,
    /// Medians of chi-square per degree of freedom (at least 1) and of the contrast.
    pub chi2: f64,
    contrast: f64,
}

impl<'a> Judge<'a> {
    pub fn new(measure: &Measure<'a>, dots: &Dots) -> Self {
        let of = |value: fn(&super::fit::Fit) -> f64| {
            finite_median(
                dots.known
                    .values()
                    .filter_map(|dot| dot.fit.as_ref().map(value)),
            )
        };
        Self {
            image: measure.image,
            sigma: measure.blur.sqrt(),
            chi2: of(|fit| fit.chi2).unwrap_or(1.0).max(1.0),
            contrast: of(|fit| fit.model.contrast).unwrap_or(1.0),
        }
    }

    /// Whether a dot lies completely inside the image, including its blurred edge.
    pub fn fits_in(&self, dot: &Ellipse) -> bool {
        let reach = dot.reach() + 0.5 + 2.0 * self.sigma;
        let (low, high) = (dot.centre - reach, dot.centre + reach);
        low.min_element() >= -0.5
            && high.x <= self.image.width as f64 - 0.5
            && high.y <= self.image.height as f64 - 0.5
    }

    /// Whether a dot fits the grid and is complete and well measured.
    pub fn accepts(&self, dots: &Dots, cell: Cell, dot: &Dot) -> bool {
        let Some(fit) = &dot.fit else { return false };
        let ellipse = &fit.model.ellipse;
        let [sure, unsure] = Ellipse {
            centre: ellipse.centre,
            shape: fit.covariance,
        }
        .half_axes();
        let alike = |ratio: f64, limit: f64| ratio < limit && ratio > 1.0 / limit;
        let expected = dots.place(cell).and_then(|place| {
            let off = place.basis.inverse() * (ellipse.centre - place.at);
            let outline = dots.outline(cell, place.at)?;
            Some((off.length(), (ellipse.size() / outline.size()).sqrt()))
        });
        self.fits_in(ellipse)
            && fit.told >= TOLD
            && fit.chi2 <= WORSE * self.chi2
            && fit.strength >= STRENGTH
            && alike(fit.model.contrast / self.contrast, CONTRAST)
            && sure > 0.0
            && unsure * self.chi2 < LEAST_SURE * LEAST_SURE
            && expected.is_some_and(|(off, ratio)| off < STRAY && alike(ratio, RADIUS))
    }

    /// Removes all dots that are not accepted.
    pub fn sift(&self, dots: &mut Dots) {
        let refused: Vec<Cell> = dots
            .known
            .iter()
            .filter(|(cell, dot)| !self.accepts(dots, **cell, dot))
            .map(|(cell, _)| *cell)
            .collect();
        for cell in refused {
            dots.known.remove(&cell);
        }
    }
}

/// Checks the sizes of dots and markers, relative to the pitch, against the specified board.
pub(super) fn proportions(dots: &Dots) -> Result<(), NotFound> {
    let Board::Dots {
        dot_mm,
        marker_mm,
        pitch_mm,
        ..
    } = *dots.board
    else {
        return Ok(());
    };
    let measured = |marker: bool| {
        finite_median(
            dots.known
                .iter()
                .filter(|(cell, _)| {
                    dots.index(**cell)
                        .is_some_and(|index| dots.board.is_marker(index) == marker)
                })
                .filter_map(|(cell, dot)| {
                    let place = dots.place(*cell)?;
                    let size = dot.fit.as_ref()?.model.ellipse.size();
                    Some(2.0 * (size / place.basis.determinant()).sqrt())
                }),
        )
    };
    let said = [dot_mm / pitch_mm, marker_mm / pitch_mm];
    let [Some(dot), Some(marker)] = [measured(false), measured(true)] else {
        return Ok(());
    };
    let alike = |a: f64, b: f64| a < b * PROPORTION && b < a * PROPORTION;
    if alike(dot, said[0]) && alike(marker, said[1]) {
        return Ok(());
    }
    Err(NotFound::WrongBoard {
        found: format!("dots of {dot:.2} and markers of {marker:.2} times the pitch"),
        wanted: format!(
            "dots of {:.2} and markers of {:.2} times the pitch, within a factor of {PROPORTION}",
            said[0], said[1]
        ),
    })
}

/// Returns an error if lit paper lies where an outer row or column of the board should be.
pub(super) fn extent(dots: &Dots, judge: &Judge) -> Result<(), NotFound> {
    let [columns, rows] = dots.board.grid().map(|n| n as i32);
    let range = |axis: usize| {
        let all = || dots.known.keys().map(|cell| cell[axis]);
        Some((all().min()?, all().max()?))
    };
    let (Some((left, right)), Some((top, bottom))) = (range(0), range(1)) else {
        return Ok(());
    };
    let lines: [(bool, Vec<Cell>); 4] = [
        (left > 0, (top..=bottom).map(|v| [left - 1, v]).collect()),
        (
            right + 1 < columns,
            (top..=bottom).map(|v| [right + 1, v]).collect(),
        ),
        (top > 0, (left..=right).map(|u| [u, top - 1]).collect()),
        (
            bottom + 1 < rows,
            (left..=right).map(|u| [u, bottom + 1]).collect(),
        ),
    ];
    for (missing, line) in lines {
        let told: Vec<bool> = line
            .iter()
            .filter_map(|&cell| judge.is_blank(dots, cell))
            .collect();
        let blank = told.iter().filter(|&&blank| blank).count();
        if missing && 2 * blank > told.len() && blank >= 4 {
            return Err(NotFound::WrongBoard {
                found: format!(
                    "a grid of {} x {} dots with blank paper beside it",
                    right - left + 1,
                    bottom - top + 1
                ),
                wanted: format!("{columns} x {rows} dots"),
            });
        }
    }
    Ok(())
}

impl Judge<'_> {
    /// Whether lit paper is visible where a cell's dot should be, compared with the paper around
    /// the neighbouring dots; `None` if that position is outside the image.
    fn is_blank(&self, dots: &Dots, cell: Cell) -> Option<bool> {
        let place = dots.place(cell)?;
        let outline = dots.outline(cell, place.at)?;
        let near = dots
            .around(cell, 2)
            .filter_map(|(_, dot)| dot.fit.as_ref().map(|fit| fit.model.paper[0]));
        let paper = finite_median(near)?;
        if !self.fits_in(&outline) {
            return None;
        }
        // Sample half-way between the dot's centre and outline, where there should be ink.
        let lit = [DVec2::X, -DVec2::X, DVec2::Y, -DVec2::Y]
            .map(|towards| (place.at + 0.5 * (outline.shape * towards)).round())
            .iter()
            .any(|px| {
                let (u, v) = (px.x as usize, px.y as usize);
                let level = self.image.level.get(v * self.image.width + u);
                level.is_some_and(|&level| f64::from(level) > LIT * paper)
            });
        Some(lit)
    }
}

/// Adds dots next to known ones until no more are found.
pub(super) fn complete(measure: &Measure, judge: &Judge, dots: &mut Dots) {
    let mut tried = BTreeSet::new();
    loop {
        let open: Vec<(Cell, Ellipse)> = dots
            .board
            .indices()
            .map(|[column, row]| [column as i32, row as i32])
            .filter(|cell| !dots.known.contains_key(cell) && !tried.contains(cell))
            .filter_map(|cell| {
                let place = dots.place(cell)?;
                let start = dots.outline(cell, place.at)?;
                judge.fits_in(&start).then_some((cell, start))
            })
            .collect();
        if open.is_empty() {
            return;
        }
        let found: Vec<Option<Dot>> = open
            .par_iter()
            .map(|&(cell, start)| {
                let dot = measure.try_at(dots, cell, start)?;
                judge.accepts(dots, cell, &dot).then_some(dot)
            })
            .collect();
        for ((cell, _), dot) in open.iter().zip(found) {
            match dot {
                Some(dot) => {
                    dots.known.insert(*cell, dot);
                }
                None => {
                    tried.insert(*cell);
                }
            }
        }
    }
}
