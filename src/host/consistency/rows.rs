//! Frames that lack rows.
//!
//! What comes after lost rows moves up. Where a surface ends or a texture changes from row to row
//! nearly all frames change, and all of them at one place; from the lost rows on, the changes of one
//! frame are whole rows above those of the others. Points there would be of neither surface: the other
//! checks see few of them, for a Gray frame is wrong only where the code of both surfaces differs.
//!
//! Frames whose patterns vary down the image have changes of their own; they are left out.
//!
//! Something that moves shifts the frames as well, but each of them little more than the one before it.

use super::changes::{Change, changes_of};
use phasmid_pattern::Image;
use std::collections::HashMap;

/// Rows that are looked for; the lack of more is seen by the other checks.
const MOST_ROWS: usize = 3;
/// A change is so many rows above the others when it is so near to that,
const NEAR: f32 = 0.35;
/// and speaks against it twice when it is no nearer than this.
const FAR: f32 = 0.65;
/// Votes that changes in one part of the image may have together: they are likely to be of one edge,
/// which may be odd.
const OF_ONE: i32 = 2;
/// Changes that have to speak for lost rows, less those that speak against them. Sound captures of five
/// built-in profiles before the scenes of a bench have at most half of it.
const LEAST: i32 = 12;

/// From a row on a frame looks as if it were some rows above the others.
struct Tail {
    row: usize,
    votes: i32,
}

/// Whether a frame is whole rows above the others, from some row on. Frames are of one size; `down` are
/// those that vary down the image.
pub(super) fn check(frames: &[Image], down: &[bool], noise_dn: f32) -> Result<(), String> {
    let mut changes = vec![Vec::new(); frames.len()];
    for change in changes_of(frames, down, noise_dn) {
        changes[change.frame].push(change);
    }
    for (frame, own) in changes.iter().enumerate() {
        for rows in 1..=MOST_ROWS {
            let Some(tail) = tail(own, rows) else {
                continue;
            };
            let before = frame.checked_sub(1).and_then(|before| changes.get(before));
            let mut beside = before.into_iter().chain(changes.get(frame + 1));
            if beside.all(|other| follows(other, rows, tail.row)) {
                continue;
            }
            return Err(format!(
                "frame {frame} is {rows} row{} above the others from about row {} on, at {} places: \
                 rows are missing, or something moved",
                if rows == 1 { "" } else { "s" },
                tail.row,
                tail.votes
            ));
        }
    }
    Ok(())
}

/// The rows from which on most changes are so many rows above the others; none where too few are.
fn tail(changes: &[Change], rows: usize) -> Option<Tail> {
    let mut ahead = 0;
    let mut found: Option<Tail> = None;
    let mut parts: HashMap<(usize, usize), i32> = HashMap::new();
    for change in changes.iter().rev() {
        let off = (change.above - rows as f32).abs();
        let part = parts.entry(change.cell).or_default();
        let before = (*part).clamp(-2 * OF_ONE, OF_ONE);
        *part += i32::from(off < NEAR) - 2 * i32::from(off > FAR);
        ahead += (*part).clamp(-2 * OF_ONE, OF_ONE) - before;
        if ahead >= found.as_ref().map_or(LEAST, |found| found.votes + 1) {
            found = Some(Tail {
                row: change.row,
                votes: ahead,
            });
        }
    }
    found
}

/// Whether a frame, too, is above the others by more than half of so many rows, from some row on.
fn follows(changes: &[Change], rows: usize, from: usize) -> bool {
    let tail = changes.iter().filter(|change| change.row >= from);
    let (mut for_it, mut all) = (0, 0);
    for change in tail {
        for_it += usize::from(change.above > 0.5 * rows as f32);
        all += 1;
    }
    2 * for_it > all
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (64, 80);

    /// Blocks of brightness, each frame with its own, `up(frame, row)` rows above where they belong.
    fn frames(up: impl Fn(usize, usize) -> usize) -> Vec<Image> {
        let (width, height) = SIZE;
        let picture = |frame: usize| {
            let pixel = |at: usize| {
                let (x, y) = (at % width, at / width);
                let block = (y + up(frame, y)) / 11 * 43 + x / 8 * 17 + frame * 13;
                (20 + block * 37 % 190) as u8
            };
            (0..width * height).map(pixel).collect::<Vec<u8>>()
        };
        let frame = |k: usize| Image::new(width, height, picture(k)).unwrap();
        (0..8).map(frame).collect()
    }

    #[test]
    fn rows_that_one_frame_lacks_are_told_and_named() {
        assert_eq!(check(&frames(|_, _| 0), &[false; 8], 0.5), Ok(()));
        for bad in [0, 3, 7] {
            for rows in 1..=MOST_ROWS {
                let lost = frames(|frame, row| rows * usize::from(frame == bad && row >= 30));
                let told = check(&lost, &[false; 8], 0.5).unwrap_err();
                let wanted = format!("frame {bad} is {rows} row");
                assert!(told.starts_with(&wanted), "{wanted}: {told}");
            }
        }
    }

    #[test]
    fn rows_that_every_second_frame_lacks_are_told() {
        for rows in 1..=MOST_ROWS {
            let lost =
                frames(|frame, row| rows * usize::from(frame % 2 == 1 && frame < 6 && row >= 30));
            let told = check(&lost, &[false; 8], 0.5).unwrap_err();
            assert!(
                told.starts_with(&format!("frame 1 is {rows} row")),
                "{told}"
            );
        }
    }

    #[test]
    fn what_moves_on_from_frame_to_frame_lacks_no_rows() {
        assert_eq!(
            check(&frames(|frame, _| frame / 2), &[false; 8], 0.5),
            Ok(())
        );
    }
}
