//! The kinds of boards, their dimensions, and the positions of a board's points.

use glam::DVec2;
use serde::{Deserialize, Serialize};

/// A calibration board. Lengths are in millimetres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "pattern", rename_all = "lowercase", deny_unknown_fields)]
pub enum Board {
    /// Dark dots on white paper. Five larger dots, the markers, identify the position in the
    /// grid.
    Dots {
        /// Dots per row, at least 7.
        columns: u32,
        /// Rows of dots, at least 7.
        rows: u32,
        /// Distance between the centres of adjacent dots.
        pitch_mm: f64,
        /// Diameter of a dot.
        dot_mm: f64,
        /// Diameter of a marker, at least 1.4 dot diameters.
        marker_mm: f64,
    },
    /// A chessboard; its points are the inner corners between squares.
    Chess {
        /// Inner corners per row: one less than the number of squares.
        columns: u32,
        /// Rows of inner corners: one less than the rows of squares.
        rows: u32,
        /// Side of a square.
        pitch_mm: f64,
    },
}

impl Board {
    /// Dot board that fits A4, with the 2.5 mm dots and 5 mm markers of Wu et al.; number and pitch of
    /// the dots are our choice.
    pub const DOTS: Self = Self::Dots {
        columns: 25,
        rows: 19,
        pitch_mm: 6.0,
        dot_mm: 2.5,
        marker_mm: 5.0,
    };
    /// 9 x 6 corners between squares of 25 mm, as in OpenCV's example.
    pub const CHESS: Self = Self::Chess {
        columns: 9,
        rows: 6,
        pitch_mm: 25.0,
    };

    /// Returns the board scaled by `factor`.
    pub fn scaled(self, factor: f64) -> Self {
        match self {
            Self::Dots {
                columns,
                rows,
                pitch_mm,
                dot_mm,
                marker_mm,
            } => Self::Dots {
                columns,
                rows,
                pitch_mm: pitch_mm * factor,
                dot_mm: dot_mm * factor,
                marker_mm: marker_mm * factor,
            },
            Self::Chess {
                columns,
                rows,
                pitch_mm,
            } => Self::Chess {
                columns,
                rows,
                pitch_mm: pitch_mm * factor,
            },
        }
    }

    /// Returns the number of columns and rows of points.
    pub fn grid(&self) -> [u32; 2] {
        match *self {
            Self::Dots { columns, rows, .. } | Self::Chess { columns, rows, .. } => [columns, rows],
        }
    }

    /// Returns the distance between adjacent points in millimetres.
    pub fn pitch_mm(&self) -> f64 {
        match *self {
            Self::Dots { pitch_mm, .. } | Self::Chess { pitch_mm, .. } => pitch_mm,
        }
    }
}

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
