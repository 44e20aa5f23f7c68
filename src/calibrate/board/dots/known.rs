//! The dots found so far, by column and row on the board.

use super::ellipse::Ellipse;
use super::fit::Fit;
use super::lattice::{Cell, Place, predict};
use glam::{DMat2, DVec2};
use phasmid_geometry::Board;
use std::collections::BTreeMap;

/// A dot found so far.
#[derive(Debug, Clone)]
pub(super) struct Dot {
    /// Initial outline, from the blob or the neighbours.
    pub start: Ellipse,
    /// Fitted outline; `None` if not fitted yet or if the fit failed.
    pub fit: Option<Fit>,
}

impl Dot {
    /// The fitted outline if there is one, else the initial one.
    pub fn ellipse(&self) -> Ellipse {
        self.fit
            .as_ref()
            .map_or(self.start, |fit| fit.model.ellipse)
    }
}

/// All dots found so far.
#[derive(Debug, Clone)]
pub(super) struct Dots<'a> {
    pub board: &'a Board,
    pub known: BTreeMap<Cell, Dot>,
}

impl Dots<'_> {
    /// Returns the board index of a cell, or `None` if the cell is outside the board.
    pub fn index(&self, cell: Cell) -> Option<[u32; 2]> {
        index(self.board, cell)
    }

    fn radius_mm(&self, cell: Cell) -> Option<f64> {
        self.index(cell).map(|index| self.board.radius_mm(index))
    }

    /// Predicts a dot's position from the dots around it.
    pub fn place(&self, cell: Cell) -> Option<Place> {
        predict(cell, |c| self.known.get(&c).map(|dot| dot.ellipse().centre))
    }

    /// Predicts a dot's outline about `centre`: the mean of the dots around it, scaled to its
    /// radius.
    pub fn outline(&self, cell: Cell, centre: DVec2) -> Option<Ellipse> {
        let radius = self.radius_mm(cell)?;
        let (mut sum, mut count) = (DMat2::ZERO, 0.0);
        let fitted = self.around(cell, 2).any(|(_, dot)| dot.fit.is_some());
        for (c, dot) in self.around(cell, 2) {
            // Use only measured dots if there are any.
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

    /// Known dots within `steps` cells of a cell, without the cell's own.
    pub fn around(&self, [u, v]: Cell, steps: i32) -> impl Iterator<Item = (Cell, &Dot)> {
        (v - steps..=v + steps)
            .flat_map(move |row| (u - steps..=u + steps).map(move |column| [column, row]))
            .filter(move |&cell| cell != [u, v])
            .filter_map(|cell| self.known.get(&cell).map(|dot| (cell, dot)))
    }
}

/// Returns the board index of a cell, or `None` if the cell is outside the board.
pub(super) fn index(board: &Board, [column, row]: Cell) -> Option<[u32; 2]> {
    let index = [u32::try_from(column).ok()?, u32::try_from(row).ok()?];
    let [columns, rows] = board.grid();
    (index[0] < columns && index[1] < rows).then_some(index)
}
