//! The share of ink in a piece of a board, such as the footprint of a pixel.
//!
//! The share is exact, dot by dot or square by square, if the piece meets at most 64 of them. For a
//! larger piece, the fraction of its area that lies on the grid is multiplied by the grid's mean share
//! of ink: a pixel with such a footprint does not resolve the pattern. A piece of zero or negligible
//! area is treated as a point.

use super::parallelogram::Parallelogram;
use super::{Board, MARKERS};
use glam::DVec2;
use std::f64::consts::PI;
use std::ops::Range;

/// Maximum number of dots or squares evaluated one by one.
const MOST: usize = 64;

impl Board {
    /// Sides of the sheet in millimetres; the grid is centred on it. A dot board has a margin of
    /// one pitch beyond the outer dot centres, a chessboard half a pitch beyond the outer squares.
    pub fn size_mm(&self) -> [f64; 2] {
        self.sheet_mm().to_array()
    }

    #[doc(hidden)]
    pub fn sheet_mm(&self) -> DVec2 {
        let cells = match self {
            Self::Dots { .. } => 1.0,
            Self::Chess { .. } => 2.0,
        };
        (self.count() + cells) * self.pitch_mm()
    }

    /// Returns the share of ink, 0 to 1, in the parallelogram centred at `at` with sides `across` and
    /// `down`, all in millimetres in the board's plane. If one of these coordinates is not finite,
    /// returns the mean over the sheet.
    ///
    /// The squares of a chessboard are dark where column + row, counted from 0, is even, so the top
    /// left square is dark.
    #[doc(hidden)]
    pub fn ink(&self, at: DVec2, across: DVec2, down: DVec2) -> f64 {
        if !(at.is_finite() && across.is_finite() && down.is_finite()) {
            let sheet = self.sheet_mm();
            let [low, high] = self.cells();
            let cells = high - low;
            return self.mean_ink() * (cells.x * cells.y) / (sheet.x * sheet.y);
        }
        match Parallelogram::new(at, across, down) {
            Some(piece) => self.ink_in(at, &piece),
            None => f64::from(u8::from(self.is_ink(at))),
        }
    }

    /// Columns and rows of points as `f64`.
    fn count(&self) -> DVec2 {
        let [columns, rows] = self.grid();
        DVec2::new(columns.into(), rows.into())
    }

    /// Corners of the rectangle of all cells. A cell is a square of one pitch: around one dot, or
    /// one square of a chessboard.
    fn cells(&self) -> [DVec2; 2] {
        let half = self.cell_count() * self.pitch_mm() / 2.0;
        [-half, half]
    }

    fn cell_count(&self) -> DVec2 {
        match self {
            Self::Dots { .. } => self.count(),
            Self::Chess { .. } => self.count() + 1.0,
        }
    }

    /// Returns the share of ink averaged over all cells of the grid.
    pub fn mean_ink(&self) -> f64 {
        let cells = self.cell_count();
        let cells = cells.x * cells.y;
        match *self {
            Self::Dots {
                pitch_mm,
                dot_mm,
                marker_mm,
                ..
            } => {
                let markers = MARKERS.len() as f64;
                let squares = (cells - markers) * dot_mm.powi(2) + markers * marker_mm.powi(2);
                PI / 4.0 * squares / (cells * pitch_mm.powi(2))
            }
            // With an odd number of squares, there is one more dark than light.
            Self::Chess { .. } => (cells / 2.0).ceil() / cells,
        }
    }

    /// Returns the ranges of columns and rows of the cells within `reach` of a point.
    fn cells_near(&self, at: DVec2, reach: DVec2) -> [Range<u32>; 2] {
        let [low, _] = self.cells();
        let number = |x: f64| (x / self.pitch_mm()).floor();
        let last = self.cell_count() - 1.0;
        [0, 1].map(|axis| {
            let from = number(at[axis] - reach[axis] - low[axis]);
            let to = number(at[axis] + reach[axis] - low[axis]);
            // Both comparisons are false if the pitch is NaN.
            match from <= last[axis] && to >= 0.0 {
                true => from.max(0.0) as u32..(to.min(last[axis]) + 1.0) as u32,
                false => 0..0,
            }
        })
    }

    fn ink_in(&self, at: DVec2, piece: &Parallelogram) -> f64 {
        // A marker larger than the pitch extends beyond its cell.
        let beyond = match *self {
            Self::Dots {
                pitch_mm,
                marker_mm,
                ..
            } => (marker_mm.max(pitch_mm) - pitch_mm) / 2.0,
            Self::Chess { .. } => 0.0,
        };
        let [columns, rows] = self.cells_near(at, piece.half + beyond);
        if columns.len().saturating_mul(rows.len()) > MOST {
            let [low, high] = self.cells();
            return self.mean_ink() * piece.in_rectangle(low, high);
        }
        let cells = rows.flat_map(|row| columns.clone().map(move |column| [column, row]));
        let share: f64 = cells.map(|cell| self.ink_of_cell(cell, piece)).sum();
        share.min(1.0)
    }

    fn ink_of_cell(&self, [column, row]: [u32; 2], piece: &Parallelogram) -> f64 {
        match self {
            Self::Dots { .. } => {
                let index = [column, row];
                piece.in_disc(self.point(index), self.radius_mm(index))
            }
            Self::Chess { pitch_mm, .. } if (column + row).is_multiple_of(2) => {
                let [origin, _] = self.cells();
                let low = origin + DVec2::new(column.into(), row.into()) * *pitch_mm;
                piece.in_rectangle(low, low + *pitch_mm)
            }
            Self::Chess { .. } => 0.0,
        }
    }

    /// Returns whether a point is inked.
    fn is_ink(&self, at: DVec2) -> bool {
        let reach = match *self {
            Self::Dots { marker_mm, .. } => marker_mm / 2.0,
            Self::Chess { .. } => 0.0,
        };
        let [columns, rows] = self.cells_near(at, DVec2::splat(reach));
        let cells = rows.flat_map(|row| columns.clone().map(move |column| [column, row]));
        let mut near = cells.take(MOST);
        match self {
            Self::Dots { .. } => {
                near.any(|index| (at - self.point(index)).length() <= self.radius_mm(index))
            }
            Self::Chess { .. } => near.any(|[column, row]| (column + row).is_multiple_of(2)),
        }
    }
}

#[cfg(test)]
mod tests;
