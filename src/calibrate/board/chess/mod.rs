//! Finds a chessboard in an image and measures its inner corners.
//!
//! - `grey`: image with invalid pixels filled in, smoothed and halved.
//! - `saddles`: finds candidate corners.
//! - `links`: links candidates along edges.
//! - `grid`: arranges linked candidates into grids.
//! - `label`: determines the board's first corner in a grid.
//! - `fit`, `edge`: measure each corner in the full-size image.
//! - `blur`: estimates the blur from all corners together.
//!
//! The search runs at full size first. If it fails, as with large squares that are out of focus or
//! noisy, it continues at a half, a quarter and an eighth of the size. The grid must contain all
//! corners of the board, because part of a chessboard does not show which part it is. A few corners
//! may still be too poor to measure.

mod blur;
mod edge;
mod fit;
mod grey;
mod grid;
mod label;
mod links;
mod saddles;
#[cfg(test)]
mod tests;

use super::sighting::check;
use super::{BoardImage, NotFound, Seen};
use blur::Blur;
use fit::{Corner, Guess, fit};
use glam::{DMat2, DVec2};
use grey::Grey;
use grid::Grid;
use phasmid_core::Stop;
use phasmid_geometry::Board;
use rayon::prelude::*;
use saddles::Saddle;

/// Number of times the image is halved if the search at full size fails.
const HALVINGS: u32 = 3;
/// An error message describes the best grid only if that grid has at least this many corners.
const WORTH_A_WORD: usize = 6;
/// Minimum distance between corners in pixels.
const LEAST_PX: f64 = 5.0;
/// Measurement may fail for at most one in this many corners of a complete board.
const SPARE: usize = 10;

/// Finds the corners of a chessboard in an image and returns them row by row, labelled as seen from
/// the front. If several corners could be the first one, a corner whose outer square is dark is
/// preferred, then the uppermost. Up to a tenth of the corners may be missing from the result,
/// because they could not be measured.
///
/// # Errors
/// Returns an error that describes the image if it contains no board, part of a board, another
/// board, or several boards.
pub fn find(board: &Board, image: &BoardImage) -> Result<Vec<Seen>, NotFound> {
    search(board, image, &Stop::default())
}

/// Like [`find`], but returns [`NotFound::Interrupted`] soon after a stop is requested.
pub(crate) fn search(
    board: &Board,
    image: &BoardImage,
    stop: &Stop,
) -> Result<Vec<Seen>, NotFound> {
    let wanted = board.grid();
    if wanted.iter().any(|&n| n < 3) {
        return Err(NotFound::Ambiguous {
            found: format!("a board of {} corners", words(wanted)),
            wanted: "3 x 3 corners or more".into(),
        });
    }
    let mut grey = Grey::of(image);
    let mut worst = Best::default();
    for halvings in 0..=HALVINGS {
        check(stop)?;
        let smoothed = grey.smoothed();
        let saddles = saddles::saddles(&smoothed);
        check(stop)?;
        let links = links::links(&smoothed, &saddles);
        let grids = grid::grids(&saddles, &links);
        let whole: Vec<&Grid> = grids.iter().filter(|g| is_whole(g, wanted)).collect();
        let scale = f64::from(1 << halvings);
        match whole[..] {
            [] => worst.consider(&saddles, &grids),
            [grid] => return measure(board, image, &saddles, grid, scale),
            _ => {
                return Err(NotFound::Ambiguous {
                    found: format!("{} boards of {} corners", whole.len(), words(wanted)),
                    wanted: "one board".into(),
                });
            }
        }
        grey = grey.halved();
    }
    Err(worst.refusal(wanted))
}

fn words([columns, rows]: [u32; 2]) -> String {
    format!("{columns} x {rows}")
}

fn is_whole(grid: &Grid, [columns, rows]: [u32; 2]) -> bool {
    let (_, size) = grid.bounds();
    grid.conflicts == 0
        && (size == [columns, rows] || size == [rows, columns])
        && grid.at.len() as u64 == u64::from(columns) * u64::from(rows)
}

/// Best partial result over all image sizes.
#[derive(Default)]
struct Best {
    saddles: usize,
    corners: usize,
    size: [u32; 2],
    conflicts: usize,
}

impl Best {
    fn consider(&mut self, saddles: &[Saddle], grids: &[Grid]) {
        self.saddles = self.saddles.max(saddles.len());
        if let Some(grid) = grids.first().filter(|g| g.at.len() > self.corners) {
            self.corners = grid.at.len();
            self.size = grid.bounds().1;
            self.conflicts = grid.conflicts;
        }
    }

    fn refusal(&self, wanted: [u32; 2]) -> NotFound {
        let [least, most] = [wanted[0].min(wanted[1]), wanted[0].max(wanted[1])];
        let [low, high] = [
            self.size[0].min(self.size[1]),
            self.size[0].max(self.size[1]),
        ];
        let all = format!("all {} corners, with a light margin", words(wanted));
        if self.corners < WORTH_A_WORD {
            return NotFound::Nothing {
                found: format!(
                    "{} corner candidates, {} of them in one grid",
                    self.saddles, self.corners
                ),
                wanted: all,
            };
        }
        let found = format!("{} corners in a grid of {}", self.corners, words(self.size));
        if low > least || high > most {
            return NotFound::WrongBoard { found, wanted: all };
        }
        if self.conflicts > 0 {
            return NotFound::Ambiguous {
                found: format!("{found}, {} of them in two places", self.conflicts),
                wanted: all,
            };
        }
        NotFound::Partial { found, wanted: all }
    }
}

/// Labels and measures a complete grid found in an image whose pixels are `scale` times as large.
fn measure(
    board: &Board,
    image: &BoardImage,
    saddles: &[Saddle],
    grid: &Grid,
    scale: f64,
) -> Result<Vec<Seen>, NotFound> {
    let px = |place: [i32; 2]| -> DVec2 {
        let saddle = grid.at.get(&place).map_or(DVec2::NAN, |&i| saddles[i].px);
        (saddle + 0.5) * scale - 0.5
    };
    let size = board.grid();
    let refused = || NotFound::Ambiguous {
        found: format!("a grid of {}", words(grid.bounds().1)),
        wanted: words(size),
    };
    let labels = label::labels(grid, size, &px).ok_or_else(refused)?;
    let last = size.map(|n| n as i32 - 1);
    let at = |column: i32, row: i32| px(labels.place([column, row]));
    let guess = |[column, row]: [u32; 2]| {
        let [column, row] = [column, row].map(|i| i as i32);
        let step = |low: i32, high: i32, at: &dyn Fn(i32) -> DVec2| {
            (at(high) - at(low)) / f64::from(high - low)
        };
        let near = |i: i32, last: i32| ((i - 1).max(0), (i + 1).min(last));
        let (left, right) = near(column, last[0]);
        let (up, down) = near(row, last[1]);
        Guess {
            px: at(column, row),
            along_x: step(left, right, &|column| at(column, row)),
            along_y: step(up, down, &|row| at(column, row)),
            dark: labels.dark == ((column + row) % 2 == 0),
        }
    };
    let mut guesses: Vec<([u32; 2], Guess)> = board.indices().map(|i| (i, guess(i))).collect();
    let corners = |guesses: &[([u32; 2], Guess)], blur: &Blur| -> Vec<Option<Corner>> {
        let corner = |(_, guess): &([u32; 2], Guess)| {
            let shortest = guess.along_x.length().min(guess.along_y.length());
            (shortest >= LEAST_PX).then(|| fit(image, guess, blur))?
        };
        guesses.par_iter().map(corner).collect()
    };
    let told = corners(&guesses, &Blur::UNKNOWN);
    let blur = Blur::told_by(told.iter().flatten().map(|corner| corner.blur));
    for ((_, guess), corner) in guesses.iter_mut().zip(&told) {
        guess.px = corner.map_or(guess.px, |corner| corner.px);
    }
    let measured = corners(&guesses, &blur);
    let lost = || {
        let indices = guesses.iter().map(|(index, _)| index);
        indices
            .zip(&measured)
            .filter(|(_, corner)| corner.is_none())
    };
    if lost().count() * SPARE > measured.len()
        && let Some(([column, row], _)) = lost().next()
    {
        return Err(NotFound::Partial {
            found: format!(
                "{} of {} corners that cannot be measured, the first in column {column} and row {row}",
                lost().count(),
                measured.len()
            ),
            wanted: format!(
                "9 of 10 of all {} corners, {LEAST_PX} px or more apart and sharper than a third of \
                 that distance, neither saturated nor hidden",
                words(size)
            ),
        });
    }
    let seen = |((index, _), corner): (&([u32; 2], Guess), &Option<Corner>)| {
        let &Corner { px, covariance, .. } = corner.as_ref()?;
        Some(Seen {
            index: *index,
            px,
            covariance,
            outline: DMat2::ZERO,
        })
    };
    Ok(guesses.iter().zip(&measured).filter_map(seen).collect())
}
