//! Reasons why the solver leaves a pose out.

use super::homography::FEWEST_POINTS;
use super::robust::OUTLYING_POSE;
use std::fmt;

/// Reasons why a pose is left out of a solution. Displays as a message for users.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Unfit {
    /// Too few points of the board are usable.
    TooFewPoints {
        /// Number of usable points.
        points: usize,
        /// Number of points off the board or without a valid covariance.
        improper: usize,
        /// Whether the usable points are on a line.
        on_a_line: bool,
    },
    /// The points do not agree on a pose of the board.
    Disagreeing {
        /// Number of points that agree.
        agree: usize,
        /// Number of points.
        points: usize,
    },
    /// The camera's image shows the board mirrored.
    MirroredCamera,
    /// The projector's coordinates lie mirrored on the board.
    MirroredProjector,
    /// According to the other poses, the board lies behind the camera or the projector.
    Behind,
    /// The pose fits much worse than the others.
    Misfit {
        /// Whether the projector's coordinates fit worst; else the camera's points do.
        projector: bool,
        /// Scale of the residuals over that of the median pose.
        ratio: f64,
    },
}

impl fmt::Display for Unfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooFewPoints {
                points,
                improper,
                on_a_line,
            } => {
                write!(f, "{points} points")?;
                if improper > 0 {
                    write!(
                        f,
                        " ({improper} more are off the board or have no valid covariance)"
                    )?;
                }
                let line = if on_a_line { " on a line" } else { "" };
                write!(
                    f,
                    "{line}; expected {FEWEST_POINTS} or more that are not on a line"
                )
            }
            Self::Disagreeing { agree, points } => write!(
                f,
                "{agree} of {points} points agree on the pose of the board; expected half of them or more"
            ),
            Self::MirroredCamera => {
                f.write_str("the image shows the board mirrored; expected its front, not flipped")
            }
            Self::MirroredProjector => {
                f.write_str("the projector's coordinates lie mirrored on the board")
            }
            Self::Behind => f.write_str(
                "according to the other poses, it lies behind the camera or the projector",
            ),
            Self::Misfit { projector, ratio } => {
                let what = if projector {
                    "projector coordinates"
                } else {
                    "camera points"
                };
                write!(
                    f,
                    "its {what} fit {ratio:.1} times worse than those of the median pose; expected \
                     {OUTLYING_POSE:.1} times or less"
                )
            }
        }
    }
}
