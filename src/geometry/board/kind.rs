//! What kinds of boards there are, and their sizes.

use serde::{Deserialize, Serialize};

/// A board. Lengths are in millimetres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "pattern", rename_all = "lowercase", deny_unknown_fields)]
pub enum Board {
    /// Dark dots on white paper; a few of them, [`MARKERS`](super::MARKERS), are larger and tell which is which.
    Dots {
        /// Dots in a row, at least 7.
        columns: u32,
        /// Rows of dots, at least 7.
        rows: u32,
        /// From one dot's centre to the next.
        pitch_mm: f64,
        /// Diameter of a dot.
        dot_mm: f64,
        /// Diameter of a marker, at least 1.4 dots.
        marker_mm: f64,
    },
    /// A chessboard: its points are the corners between squares.
    Chess {
        /// Inner corners in a row: one less than squares.
        columns: u32,
        /// Rows of inner corners: one less than squares.
        rows: u32,
        /// Side of a square.
        pitch_mm: f64,
    },
}

impl Board {
    /// The paper's dots of 2.5 mm with markers of 5 mm; how many and how far apart is ours. It fits
    /// A4.
    pub const DOTS: Self = Self::Dots {
        columns: 25,
        rows: 19,
        pitch_mm: 6.0,
        dot_mm: 2.5,
        marker_mm: 5.0,
    };
    /// 9 x 6 corners of squares of 25 mm, OpenCV's example.
    pub const CHESS: Self = Self::Chess {
        columns: 9,
        rows: 6,
        pitch_mm: 25.0,
    };

    /// The same board `factor` times as large.
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

    /// Columns and rows of points.
    pub fn grid(&self) -> [u32; 2] {
        match *self {
            Self::Dots { columns, rows, .. } | Self::Chess { columns, rows, .. } => [columns, rows],
        }
    }

    /// From one point to the next in millimetres.
    pub fn pitch_mm(&self) -> f64 {
        match *self {
            Self::Dots { pitch_mm, .. } | Self::Chess { pitch_mm, .. } => pitch_mm,
        }
    }
}
