//! The board's dots as they are known so far, by their columns and rows.

use super::ellipse::Ellipse;
use super::fit::Fit;
use super::lattice::{Cell, Place, predict};
use glam::{DMat2, DVec2};
use phasmid_geometry::Board;
use std::collections::BTreeMap;

/// What is known of a dot.
#[derive(Debug, Clone)]
pub(super) struct Dot {
    /// Where it seems to be.
    pub start: Ellipse,
    /// Where it is.
    pub fit: Option<Fit>,
}

impl Dot {
    /// The best that is known.
    pub fn ellipse(&self) -> Ellipse {
        self.fit
            .as_ref()
            .map_or(self.start, |fit| fit.model.ellipse)
    }
}

/// All dots that are known.
#[derive(Debug, Clone)]
pub(super) struct Dots<'a> {
    pub board: &'a Board,
    pub known: BTreeMap<Cell, Dot>,
}

impl Dots<'_> {
    /// The board's point with a column and row, if it has it.
    pub fn index(&self, cell: Cell) -> Option<[u32; 2]> {
        index(self.board, cell)
    }

    fn radius_mm(&self, cell: Cell) -> Option<f64> {
        self.index(cell).map(|index| self.board.radius_mm(index))
    }

    /// Where a dot should be by those around it.
    pub fn place(&self, cell: Cell) -> Option<Place> {
        predict(cell, |c| self.known.get(&c).map(|dot| dot.ellipse().centre))
    }

    /// The outline that a dot should have by those around it, about a centre: the mean of theirs.
    pub fn outline(&self, cell: Cell, centre: DVec2) -> Option<Ellipse> {
        let radius = self.radius_mm(cell)?;
        let (mut sum, mut count) = (DMat2::ZERO, 0.0);
        let fitted = self.around(cell, 2).any(|(_, dot)| dot.fit.is_some());
        for (c, dot) in self.around(cell, 2) {
            // Those that are measured, if there are any.
            if fitted && dot.fit.is_none() {
                continue;
            }
            let theirs = self.radius_mm(c)?;
            sum += dot.ellipse().shape * (radius / theirs);
            count += 1.0;
        }
        (count > 0.0).then(|| Ellipse {
            centre,
            shape: sum * (1.0 / count),
        })
    }

    /// Known dots around a cell, without its own.
    pub fn around(&self, [u, v]: Cell, steps: i32) -> impl Iterator<Item = (Cell, &Dot)> {
        (v - steps..=v + steps)
            .flat_map(move |row| (u - steps..=u + steps).map(move |column| [column, row]))
            .filter(move |&cell| cell != [u, v])
            .filter_map(|cell| self.known.get(&cell).map(|dot| (cell, dot)))
    }
}

/// The board's point with a column and row, if it has it.
pub(super) fn index(board: &Board, [column, row]: Cell) -> Option<[u32; 2]> {
    let index = [u32::try_from(column).ok()?, u32::try_from(row).ok()?];
    let [columns, rows] = board.grid();
    (index[0] < columns && index[1] < rows).then_some(index)
}

/// The median, if there is any.
pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|v| v.is_finite());
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}
