//! Validates board parameters.

use super::Board;
use crate::shapes::Violation;
use std::ops::RangeInclusive;

/// Allowed columns and rows of dots: every marker needs neighbours on all sides.
const DOTS: RangeInclusive<u32> = 7..=199;
const CORNERS: RangeInclusive<u32> = 2..=199;
const PITCH_MM: RangeInclusive<f64> = 1e-3..=1e6;
/// Minimum diameter of a marker, in dot diameters.
const MARKER: f64 = 1.4;

impl Board {
    /// Checks that the board can be printed and that a detector can tell markers from dots.
    ///
    /// A chessboard whose columns and rows add up to an even number looks the same rotated by 180
    /// degrees. It is allowed; callers that need the orientation must choose another board.
    ///
    /// # Errors
    /// Returns the first invalid field, its value and the allowed values.
    pub fn check(&self) -> Result<(), Violation> {
        let [columns, rows] = self.grid();
        let allowed = match self {
            Self::Dots { .. } => DOTS,
            Self::Chess { .. } => CORNERS,
        };
        for (field, count) in [("columns", columns), ("rows", rows)] {
            let (least, most) = (allowed.start(), allowed.end());
            let text = || format!("{least} to {most}");
            that(allowed.contains(&count), field, count, text)?;
        }
        // NaN is outside every range.
        let pitch = self.pitch_mm();
        that(PITCH_MM.contains(&pitch), "pitch_mm", pitch, || {
            format!("{} to {}", PITCH_MM.start(), PITCH_MM.end())
        })?;
        let Self::Dots {
            dot_mm, marker_mm, ..
        } = *self
        else {
            return Ok(());
        };
        that(dot_mm > 0.0 && dot_mm < pitch, "dot_mm", dot_mm, || {
            format!("above 0 and below the pitch of {pitch} mm, so that dots do not touch")
        })?;
        // Markers are at least two pitches from each other and one from the next dot.
        let (least, most) = (MARKER * dot_mm, 2.0 * pitch - dot_mm);
        let fits = marker_mm >= least * (1.0 - 1e-12) && marker_mm < most;
        that(fits, "marker_mm", marker_mm, || {
            format!(
                "at least {least} mm ({MARKER} dot diameters) and below {most} mm, so that it touches no dot"
            )
        })
    }
}

fn that(
    ok: bool,
    field: &'static str,
    found: impl ToString,
    allowed: impl Fn() -> String,
) -> Result<(), Violation> {
    match ok {
        true => Ok(()),
        false => Err((field, found.to_string(), allowed())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dots(columns: u32, rows: u32, sizes: [f64; 3]) -> Board {
        let [pitch_mm, dot_mm, marker_mm] = sizes;
        Board::Dots {
            columns,
            rows,
            pitch_mm,
            dot_mm,
            marker_mm,
        }
    }

    #[test]
    fn impossible_boards_are_refused_by_field() {
        for good in [
            Board::DOTS,
            Board::CHESS,
            Board::DOTS.scaled(4.0),
            Board::DOTS.scaled(0.1),
            dots(7, 7, [6.0, 2.5, 3.5]),
            dots(199, 199, [1.0, 0.5, 0.7]),
        ] {
            assert_eq!(good.check(), Ok(()), "{good:?}");
        }
        for (bad, field) in [
            (dots(6, 19, [6.0, 2.5, 5.0]), "columns"),
            (dots(25, 200, [6.0, 2.5, 5.0]), "rows"),
            (dots(25, 19, [0.0, 2.5, 5.0]), "pitch_mm"),
            (dots(25, 19, [f64::NAN, 2.5, 5.0]), "pitch_mm"),
            (dots(25, 19, [f64::INFINITY, 2.5, 5.0]), "pitch_mm"),
            (dots(25, 19, [6.0, 6.0, 9.0]), "dot_mm"),
            (dots(25, 19, [6.0, f64::NAN, 5.0]), "dot_mm"),
            (dots(25, 19, [6.0, -1.0, 5.0]), "dot_mm"),
            (dots(25, 19, [6.0, 2.5, 3.4]), "marker_mm"),
            (dots(25, 19, [6.0, 2.5, 9.5]), "marker_mm"),
            (dots(25, 19, [6.0, 2.5, f64::NAN]), "marker_mm"),
        ] {
            let (found, _, allowed) = bad.check().unwrap_err();
            assert_eq!(found, field, "{bad:?}: {allowed}");
        }
        let chess = |columns, rows| Board::Chess {
            columns,
            rows,
            pitch_mm: 1.0,
        };
        assert_eq!(chess(2, 199).check(), Ok(()));
        assert_eq!(chess(1, 9).check().unwrap_err().0, "columns");
        assert_eq!(chess(9, 0).check().unwrap_err().0, "rows");
    }
}
