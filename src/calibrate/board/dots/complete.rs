//! Finds dots that the blob search missed, at the positions their neighbours predict.

use super::ellipse::Ellipse;
use super::judge::Judge;
use super::known::{Dot, Dots};
use super::lattice::Cell;
use super::measure::Measure;
use rayon::prelude::*;
use std::collections::BTreeSet;

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
