//! Marks the measured points of a board in the image, for inspection.
//!
//! Each row of the board has its own colour and a line through its points. A dot is marked by its
//! outline and a cross at its centroid, a marker of the board by an additional white outline, and a
//! corner by a cross in a circle. At the first point, labelled with its column and row, arrows show
//! the directions of increasing column (x) and row (y). The caption in the upper left corner gives
//! the number of points.

mod pen;

use super::{BoardImage, Seen};
use glam::{DMat2, DVec2};
use image::{Rgb, RgbImage};
use pen::Pen;
use phasmid_geometry::Board;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Colour of saturated pixels, which have no level.
const SATURATED: [u8; 3] = [255, 236, 170];
const INK: [u8; 3] = [240, 240, 240];
const X: [u8; 3] = [255, 70, 60];
const Y: [u8; 3] = [60, 230, 90];
/// Images are enlarged by the largest integer factor, at most 4, for which the longer side is at
/// most this many pixels.
const SIDE: usize = 1400;

/// Draws the points on the image, enlarged if it is small. Saturated pixels are yellowish. Returns
/// an empty image if the number of levels differs from the number of pixels.
pub fn draw(picture: &BoardImage, board: &Board, seen: &[Seen]) -> RgbImage {
    let sizes = u32::try_from(picture.width)
        .ok()
        .zip(u32::try_from(picture.height).ok());
    let Some((width, height)) =
        sizes.filter(|_| picture.width.checked_mul(picture.height) == Some(picture.level.len()))
    else {
        return RgbImage::new(0, 0);
    };
    let zoom = (SIDE / picture.width.max(picture.height).max(1)).clamp(1, 4) as u32;
    let tones = tones(&picture.level);
    let mut image = RgbImage::from_fn(width * zoom, height * zoom, |x, y| {
        Rgb(tones[(y / zoom) as usize * picture.width + (x / zoom) as usize])
    });
    let mut pen = Pen::new(&mut image, f64::from(zoom));
    let at: BTreeMap<[u32; 2], DVec2> = seen.iter().map(|s| (s.index, s.px)).collect();
    for s in seen {
        let colour = colour_of(s.index[1]);
        let [column, row] = s.index;
        let next = column.checked_add(1).and_then(|c| at.get(&[c, row]));
        if let Some(next) = next {
            pen.line(s.px, *next, colour);
        }
        let reach = spacing(&at, s).map_or(4.0, |d| (0.25 * d).clamp(2.0, 8.0));
        pen.cross(s.px, reach, colour);
        if is_corner(s) {
            outline(&mut pen, s.px, DMat2::IDENTITY * reach, colour);
        } else {
            outline(&mut pen, s.px, s.outline, colour);
        }
        if board.is_marker(s.index) {
            outline(&mut pen, s.px, s.outline * 1.25, INK);
        }
    }
    axes(&mut pen, &at);
    let [columns, rows] = board.grid();
    let total = u64::from(columns) * u64::from(rows);
    caption(&mut image, &format!("{} of {total} points", seen.len()));
    image
}

/// Converts levels to display colours: the 99th percentile becomes white, and the gamma is 2.2.
fn tones(level: &[f32]) -> Vec<[u8; 3]> {
    let stride = (level.len() / 20_000).max(1);
    let mut some: Vec<f32> = level.iter().step_by(stride).copied().collect();
    some.retain(|v| v.is_finite());
    some.sort_by(f32::total_cmp);
    let white = some
        .get(some.len() * 99 / 100)
        .copied()
        .unwrap_or(1.0)
        .max(1e-6);
    let tone = |&v: &f32| {
        if v.is_nan() {
            return SATURATED;
        }
        let light = (v / white).clamp(0.0, 1.0).powf(1.0 / 2.2);
        [(light * 235.0) as u8; 3]
    };
    level.iter().map(tone).collect()
}

/// Colour of a row: hues advance by the golden angle, so that neighbouring rows differ clearly.
fn colour_of(row: u32) -> [u8; 3] {
    const GOLDEN: f64 = 0.381_966;
    let turn = GOLDEN * f64::from(row);
    [0.0, 1.0 / 3.0, 2.0 / 3.0].map(|phase| {
        let wave = 0.5 + 0.5 * (TAU * (turn - phase)).cos();
        (40.0 + 215.0 * wave.sqrt()) as u8
    })
}

/// Distance to the nearest neighbour in the row or column.
fn spacing(at: &BTreeMap<[u32; 2], DVec2>, s: &Seen) -> Option<f64> {
    let [column, row] = s.index;
    let beside = [
        [column.wrapping_add(1), row],
        [column.wrapping_sub(1), row],
        [column, row.wrapping_add(1)],
        [column, row.wrapping_sub(1)],
    ];
    let lengths = beside
        .iter()
        .filter_map(|i| at.get(i))
        .map(|p| p.distance(s.px));
    lengths.min_by(f64::total_cmp)
}

fn is_corner(s: &Seen) -> bool {
    s.outline.x_axis == DVec2::ZERO && s.outline.y_axis == DVec2::ZERO
}

/// Draws the unit circle, transformed by `of_circle`, about `middle`.
fn outline(pen: &mut Pen<'_>, middle: DVec2, of_circle: DMat2, colour: [u8; 3]) {
    const SIDES: u32 = 48;
    let at = |i: u32| {
        let angle = TAU * f64::from(i) / f64::from(SIDES);
        middle + of_circle * DVec2::from_angle(angle)
    };
    for i in 0..SIDES {
        pen.line(at(i), at(i + 1), colour);
    }
}

/// Draws arrows from the first point, counted row by row, whose right and lower neighbours were
/// both found.
fn axes(pen: &mut Pen<'_>, at: &BTreeMap<[u32; 2], DVec2>) {
    let mut by_row: Vec<(&[u32; 2], &DVec2)> = at.iter().collect();
    by_row.sort_by_key(|(index, _)| (index[1], index[0]));
    let next = |[column, row]: [u32; 2]| {
        let right = at.get(&[column.checked_add(1)?, row])?;
        let down = at.get(&[column, row.checked_add(1)?])?;
        Some((*right, *down))
    };
    let first = by_row
        .iter()
        .find_map(|&(index, px)| Some((*index, *px, next(*index)?)));
    let Some((index, px, (right, down))) = first else {
        return;
    };
    for (to, aside, colour, name) in [(right, down, X, "x"), (down, right, Y, "y")] {
        let tip = px + (to - px) * 1.6;
        pen.arrow(px, tip, colour);
        let away = px - aside;
        pen.text(tip + away * 0.3, away, name, colour);
    }
    let away = (px - right) + (px - down);
    let index = format!("({}, {})", index[0], index[1]);
    pen.text(px + away * 0.3, away, &index, INK);
}

fn caption(image: &mut RgbImage, text: &str) {
    pen::label(image, text, (0, 0), INK);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: usize, height: usize) -> BoardImage {
        let level = (0..width * height).map(|i| (i % width) as f32).collect();
        BoardImage {
            width,
            height,
            level,
            variance: vec![1.0; width * height],
        }
    }

    fn seen(board: &Board, pitch: f64, radius: f64) -> Vec<Seen> {
        let at = |index: [u32; 2]| Seen {
            index,
            px: DVec2::new(
                60.0 + pitch * f64::from(index[0]),
                50.0 + pitch * f64::from(index[1]),
            ),
            covariance: DMat2::IDENTITY * 1e-4,
            outline: DMat2::IDENTITY * radius,
        };
        board.indices().map(at).collect()
    }

    #[test]
    fn points_are_marked_at_their_places() {
        let board = Board::DOTS;
        let mut picture = picture(1000, 500);
        picture.level[400_000] = f32::NAN;
        let bare = draw(&picture, &board, &[]);
        assert_eq!(bare.get_pixel(0, 400).0, SATURATED);
        let found = seen(&board, 20.0, 5.0);
        let image = draw(&picture, &board, &found);
        assert_eq!((image.width(), image.height()), (1000, 500));
        let colour = |row| colour_of(row);
        // A cross and an outline in the row's colour, away from the row's line.
        for s in &found {
            let [column, row] = s.index;
            let (x, y) = (60 + 20 * column, 50 + 20 * row);
            if column > 3 && row > 3 {
                assert_eq!(image.get_pixel(x, y + 2).0, colour(row));
                assert_eq!(image.get_pixel(x, y + 5).0, colour(row));
                let ring = image.get_pixel(x, y + 6).0;
                assert_eq!(ring == INK, board.is_marker(s.index), "{column} {row}");
            }
        }
        for row in 1..19 {
            assert_ne!(colour(row), colour(row - 1));
        }
        // The caption's background and the arrows of the first point.
        assert_eq!(image.get_pixel(0, 0).0, pen::PAPER);
        assert!(image.pixels().any(|p| p.0 == X) && image.pixels().any(|p| p.0 == Y));
        let changed = image
            .pixels()
            .zip(bare.pixels())
            .filter(|(a, b)| a != b)
            .count();
        assert!(changed > 10_000, "{changed}");
    }

    #[test]
    fn small_pictures_are_enlarged_and_invalid_ones_do_not_panic() {
        let board = Board::CHESS;
        assert_eq!(
            draw(&picture(300, 200), &board, &seen(&board, 10.0, 0.0)).width(),
            1200
        );
        for (width, height) in [(0, 0), (1, 1), (3, 1), (1, 9)] {
            draw(&picture(width, height), &board, &seen(&board, 30.0, 0.0));
        }
        let broken = BoardImage {
            level: vec![0.0; 3],
            width: 1 << 40,
            ..picture(1, 1)
        };
        assert_eq!(draw(&broken, &board, &[]).width(), 0);
        let mut odd = seen(&board, 1e9, f64::NAN);
        odd[0].px = DVec2::NAN;
        odd[1].index = [u32::MAX; 2];
        odd[2].px = DVec2::splat(f64::INFINITY);
        odd[3].outline = DMat2::IDENTITY * 1e300;
        draw(&picture(100, 80), &board, &odd);
        let dark = BoardImage {
            level: vec![f32::NAN; 64],
            ..picture(8, 8)
        };
        draw(&dark, &board, &odd);
    }
}
