//! Options that describe a calibration board.

use phasmid_core::error::{Error, Result};
use phasmid_geometry::Board;
use std::fmt::Display;

/// Describes a calibration board. A length that is not given is that of the default board, scaled
/// in proportion to the pitch. The default boards are the board of dots of Wu et al. and a common
/// chessboard.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct BoardArgs {
    /// Pattern of the board
    #[arg(long, visible_alias = "kind", value_enum, value_name = "KIND", default_value_t = Kind::Dots)]
    board: Kind,
    /// Number of columns of dots, or of inner corners [default: 25 dots, 9 corners]
    #[arg(long, value_name = "N")]
    columns: Option<u32>,
    /// Number of rows of dots, or of inner corners [default: 19 dots, 6 corners]
    #[arg(long, value_name = "N")]
    rows: Option<u32>,
    /// Distance between neighbouring points in millimetres [default: 6 for dots, 25 for corners]
    #[arg(long, value_name = "MM")]
    pitch_mm: Option<f64>,
    /// Diameter of a dot in millimetres [default: 2.5 at a pitch of 6, in proportion to the pitch]
    #[arg(long, value_name = "MM")]
    dot_mm: Option<f64>,
    /// Diameter of a marker in millimetres [default: twice that of a dot]
    #[arg(long, value_name = "MM")]
    marker_mm: Option<f64>,
    /// Factor on all lengths, given or default
    #[arg(long, value_name = "FACTOR")]
    scale: Option<f64>,
}

/// Pattern of a board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Kind {
    /// A grid of dots, five of which are larger markers
    Dots,
    /// A chessboard
    Chess,
}

impl BoardArgs {
    /// Returns the board that the options describe. Without `--pitch-mm` and `--scale`, the pitch is
    /// the default's times `default_scale`.
    ///
    /// # Errors
    /// Returns an error if a size does not apply to this pattern or [`Board::check`] rejects the
    /// board.
    pub(super) fn board(&self, default_scale: f64) -> Result<Board> {
        let scale = self.scale.unwrap_or(1.0);
        if !(scale > 0.0 && scale.is_finite()) {
            return Err(refused("scale", scale, "a finite number above 0"));
        }
        let default = match self.board {
            Kind::Dots => Board::DOTS,
            Kind::Chess => Board::CHESS,
        };
        // If `--scale` is given, it applies to the default board, and `default_scale` is ignored.
        let by_default = match self.scale {
            Some(_) => default,
            None => default.scaled(default_scale),
        };
        let pitch_mm = self.pitch_mm.unwrap_or(by_default.pitch_mm());
        let [columns, rows] = default.grid();
        let columns = self.columns.unwrap_or(columns);
        let rows = self.rows.unwrap_or(rows);
        let board = match default {
            Board::Dots {
                pitch_mm: default_pitch_mm,
                dot_mm,
                marker_mm,
                ..
            } => {
                let twice = marker_mm / dot_mm;
                let dot_mm = self.dot_mm.unwrap_or(pitch_mm * dot_mm / default_pitch_mm);
                Board::Dots {
                    columns,
                    rows,
                    pitch_mm,
                    dot_mm,
                    marker_mm: self.marker_mm.unwrap_or(dot_mm * twice),
                }
            }
            Board::Chess { .. } => {
                for (field, given) in [("dot-mm", self.dot_mm), ("marker-mm", self.marker_mm)] {
                    if let Some(found) = given {
                        return Err(refused(
                            field,
                            found,
                            "no dot size: a chessboard has no dots",
                        ));
                    }
                }
                Board::Chess {
                    columns,
                    rows,
                    pitch_mm,
                }
            }
        };
        let scaled = board.scaled(scale);
        match (scaled.check(), board.check()) {
            (Ok(()), _) => Ok(scaled),
            // The board is valid before scaling, so the scale is at fault.
            (Err((field, _, allowed)), Ok(())) => Err(refused(
                "scale",
                format!("{scale:?}"),
                format!("a factor for which {field} is {allowed}"),
            )),
            (Err((field, found, allowed)), Err(_)) => {
                Err(refused(&field.replace('_', "-"), found, allowed))
            }
        }
    }
}

fn refused(field: &str, found: impl Display, allowed: impl Display) -> Error {
    Error::input(format!("--{field}"), found, allowed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        board: BoardArgs,
    }

    fn board(line: &str, default_scale: f64) -> Result<Board> {
        let words = std::iter::once("phasmid").chain(line.split_whitespace());
        Line::try_parse_from(words)
            .unwrap()
            .board
            .board(default_scale)
    }

    #[test]
    fn sizes_not_given_are_in_proportion() {
        assert_eq!(board("", 1.0).unwrap(), Board::DOTS);
        assert_eq!(board("", 4.0).unwrap(), Board::DOTS.scaled(4.0));
        assert_eq!(board("--scale 1", 4.0).unwrap(), Board::DOTS);
        assert_eq!(
            board("--kind dots --scale 4", 1.0).unwrap(),
            Board::DOTS.scaled(4.0)
        );
        assert_eq!(
            board("--pitch-mm 12", 4.0).unwrap(),
            Board::DOTS.scaled(2.0)
        );
        assert_eq!(board("--board chess", 1.0).unwrap(), Board::CHESS);
        let own = "--columns 7 --rows 9 --pitch-mm 10 --dot-mm 4 --marker-mm 6 --scale 2";
        let wanted = Board::Dots {
            columns: 7,
            rows: 9,
            pitch_mm: 20.0,
            dot_mm: 8.0,
            marker_mm: 12.0,
        };
        assert_eq!(board(own, 4.0).unwrap(), wanted);
    }

    #[test]
    fn impossible_values_are_refused_with_their_flag() {
        for (line, words) in [
            ("--columns 6", "--columns: 6; expected 7 to 199"),
            ("--board chess --rows 1", "--rows: 1; expected 2 to 199"),
            (
                "--board chess --dot-mm 2",
                "--dot-mm: 2; expected no dot size: a chessboard has no dots",
            ),
            ("--pitch-mm NaN", "--pitch-mm: NaN"),
            ("--scale 0", "--scale: 0"),
            ("--scale inf", "--scale: inf"),
            (
                "--scale 1e300",
                "--scale: 1e300; expected a factor for which pitch_mm is 0.001",
            ),
            ("--scale 1e-9 --board chess", "--scale: 1e-9; expected "),
            ("--scale 2 --pitch-mm 0", "--pitch-mm: 0; expected "),
            ("--dot-mm 7", "--dot-mm: 7"),
            ("--marker-mm 3", "--marker-mm: 3"),
        ] {
            let error = board(line, 1.0).unwrap_err();
            assert!(error.to_string().starts_with(words), "{line}: {error}");
            assert_eq!(error.exit_code(), 2);
        }
    }
}
