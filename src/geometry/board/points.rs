//! Positions of a board's points.

use super::Board;
use glam::DVec2;

/// Columns and rows of a dot board's markers relative to its middle dot, (columns / 2, rows / 2)
/// rounded down. No rotation or reflection of the grid maps the markers to themselves, nor any four
/// of them to another four, so the orientation is unique even with one marker hidden.
pub const MARKERS: [[i32; 2]; 5] = [[0, 0], [2, 0], [-2, 1], [0, -2], [1, 2]];

impl Board {
    /// Returns whether the point in this column and row is a marker.
    pub fn is_marker(&self, [column, row]: [u32; 2]) -> bool {
        let [columns, rows] = self.grid();
        let from_middle = |at: u32, of: u32| at as i32 - (of / 2) as i32;
        let place = [from_middle(column, columns), from_middle(row, rows)];
        matches!(self, Self::Dots { .. }) && MARKERS.contains(&place)
    }

    /// Radius in millimetres of the dot at a column and row; 0 for a chessboard corner.
    pub fn radius_mm(&self, index: [u32; 2]) -> f64 {
        match *self {
            Self::Dots {
                dot_mm, marker_mm, ..
            } => {
                let diameter = if self.is_marker(index) {
                    marker_mm
                } else {
                    dot_mm
                };
                diameter / 2.0
            }
            Self::Chess { .. } => 0.0,
        }
    }

    /// Returns the point in a column and row, in millimetres in the board's frame.
    pub fn point_mm(&self, index: [u32; 2]) -> [f64; 2] {
        self.point(index).to_array()
    }

    #[doc(hidden)]
    pub fn point(&self, [column, row]: [u32; 2]) -> DVec2 {
        let [columns, rows] = self.grid();
        let middle = (DVec2::new(columns.into(), rows.into()) - 1.0) / 2.0;
        (DVec2::new(f64::from(column), f64::from(row)) - middle) * self.pitch_mm()
    }

    /// Iterates over the (column, row) indices of all points, row by row.
    pub fn indices(&self) -> impl Iterator<Item = [u32; 2]> + use<> {
        let [columns, rows] = self.grid();
        (0..rows).flat_map(move |row| (0..columns).map(move |column| [column, row]))
    }
}
