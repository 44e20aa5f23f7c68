//! From blobs to a grid of them.
//!
//! A dot's own ellipse tells how its surroundings are foreshortened: in the metric that makes it a
//! circle, its four neighbours lie at equal distances and right angles, which tells them from the
//! diagonals at any tilt. A dot with eight neighbours in their places is a seed; from there the grid
//! grows, each place predicted by the affine map that fits the dots already placed around it. The
//! remainder, a few percent of a pitch, is perspective and distortion.

use super::blobs::Blob;
use glam::{DMat2, DVec2};
use std::collections::{BTreeMap, VecDeque};

/// Column and row in a grid's own numbers.
pub(super) type Cell = [i32; 2];

/// Neighbours are looked for within this many half axes of a blob: pitch over radius is near 5.
const FAR: f64 = 14.0;
/// Deviation of a seed's neighbours from its parallelograms, in pitches.
const SEED: f64 = 0.2;
/// Deviation of a dot from where it was predicted, in pitches.
const STRAY: f64 = 0.25;
/// How much larger or smaller than the dots around it a dot may be by area.
const SIZES: std::ops::Range<f64> = 0.2..9.0;
/// Cells around a cell that say where it is.
const AROUND: i32 = 2;
/// Seeds that are tried, and grids that are grown.
const TRIES: usize = 64;

/// Blobs by their places in a grid.
pub(super) type Grid = BTreeMap<Cell, usize>;

/// Blobs sorted by their x, to find those near a place.
struct Finder<'a> {
    blobs: &'a [Blob],
    by_x: Vec<(f64, usize)>,
}

impl<'a> Finder<'a> {
    fn new(blobs: &'a [Blob]) -> Self {
        let mut by_x: Vec<(f64, usize)> = blobs
            .iter()
            .enumerate()
            .map(|(k, b)| (b.ellipse.centre.x, k))
            .collect();
        by_x.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self { blobs, by_x }
    }

    /// Blobs whose x and y are within `reach` of a place.
    fn near(&self, place: DVec2, reach: DVec2) -> impl Iterator<Item = usize> + '_ {
        let first = self.by_x.partition_point(|&(x, _)| x < place.x - reach.x);
        self.by_x[first..]
            .iter()
            .take_while(move |&&(x, _)| x <= place.x + reach.x)
            .map(|&(_, k)| k)
            .filter(move |&k| (self.blobs[k].ellipse.centre.y - place.y).abs() <= reach.y)
    }
}

/// Grids among the blobs, the largest first; no blob is in two.
pub(super) fn grids(blobs: &[Blob]) -> Vec<Grid> {
    let finder = Finder::new(blobs);
    let mut seeds: Vec<(f64, Seed)> = (0..blobs.len())
        .filter_map(|k| seed(blobs, &finder, k))
        .collect();
    seeds.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.middle.cmp(&b.1.middle)));
    let mut taken = vec![false; blobs.len()];
    let mut found = Vec::new();
    for (_, seed) in seeds {
        if found.len() >= TRIES {
            break;
        }
        if seed.cells.iter().any(|&(_, k)| taken[k]) {
            continue;
        }
        let grid = grow(blobs, &finder, &seed, &mut taken);
        found.push(grid);
    }
    found.sort_by_key(|grid| std::cmp::Reverse(grid.len()));
    found
}

/// Nine blobs that are a grid of three by three.
struct Seed {
    middle: usize,
    cells: Vec<(Cell, usize)>,
}

fn seed(blobs: &[Blob], finder: &Finder, middle: usize) -> Option<(f64, Seed)> {
    let ellipse = blobs[middle].ellipse;
    let here = ellipse.centre;
    let round = ellipse.shape.inverse();
    let mut near: Vec<(f64, DVec2, usize)> = finder
        .near(here, ellipse.reach() * FAR)
        .filter(|&k| k != middle && SIZES.contains(&(blobs[k].mass / blobs[middle].mass)))
        .map(|k| {
            let away = round * (blobs[k].ellipse.centre - here);
            (away.length(), away, k)
        })
        .filter(|n| n.0 <= FAR)
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Eight neighbours, and as many that may be none.
    near.truncate(24);
    let &(length, one, right) = near.first()?;
    let closest = |to: DVec2, within: f64| {
        near.iter()
            .map(|&(_, away, k)| ((away - to).length(), k))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .filter(|n| n.0 < within)
            .map(|n| n.1)
    };
    let rough = 0.35 * length;
    let left = closest(-one, rough)?;
    let down = closest(one.perp(), rough)?;
    let up = closest(-one.perp(), rough)?;
    let at = |k: usize| blobs[k].ellipse.centre;
    let (across, along) = (0.5 * (at(right) - at(left)), 0.5 * (at(down) - at(up)));
    let basis = DMat2::from_cols(across, along);
    // y of the grid is clockwise of x on the picture, as on the board.
    if !(basis.determinant() > 0.0) {
        return None;
    }
    let inverse = basis.inverse();
    let mut cells = vec![([0, 0], middle)];
    let mut deviation = 0.0;
    for v in -1..=1 {
        for u in -1..=1 {
            if [u, v] == [0, 0] {
                continue;
            }
            let to = here + basis * DVec2::new(f64::from(u), f64::from(v));
            let (off, k) = near
                .iter()
                .map(|&(_, _, k)| ((inverse * (at(k) - to)).length(), k))
                .min_by(|a, b| a.0.total_cmp(&b.0))?;
            if !(off < SEED) {
                return None;
            }
            deviation += off * off;
            cells.push(([u, v], k));
        }
    }
    Some((deviation, Seed { middle, cells }))
}

fn grow(blobs: &[Blob], finder: &Finder, seed: &Seed, taken: &mut [bool]) -> Grid {
    let mut grid = Grid::new();
    let mut queue = VecDeque::new();
    let place = |cell: Cell, k: usize, grid: &mut Grid, queue: &mut VecDeque<Cell>| {
        grid.insert(cell, k);
        let [u, v] = cell;
        for next in [[u + 1, v], [u - 1, v], [u, v + 1], [u, v - 1]] {
            if !grid.contains_key(&next) {
                queue.push_back(next);
            }
        }
    };
    for &(cell, k) in &seed.cells {
        taken[k] = true;
        place(cell, k, &mut grid, &mut queue);
    }
    while let Some(cell) = queue.pop_front() {
        if grid.contains_key(&cell) {
            continue;
        }
        let Some(here) = predict(cell, |c| grid.get(&c).map(|&k| blobs[k].ellipse.centre)) else {
            continue;
        };
        let mass = typical(cell, |c| grid.get(&c).map(|&k| blobs[k].mass)).unwrap_or(0.0);
        let inverse = here.basis.inverse();
        let reach = STRAY * (here.basis.x_axis.abs() + here.basis.y_axis.abs());
        let found = finder
            .near(here.at, reach)
            .filter(|&k| !taken[k] && SIZES.contains(&(blobs[k].mass / mass)))
            .map(|k| ((inverse * (blobs[k].ellipse.centre - here.at)).length(), k))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .filter(|n| n.0 < STRAY);
        if let Some((_, k)) = found {
            taken[k] = true;
            place(cell, k, &mut grid, &mut queue);
        }
    }
    grid
}

/// Where a cell should be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    /// In pixels.
    pub at: DVec2,
    /// Steps to the next column and row in pixels.
    pub basis: DMat2,
}

/// Where a cell is by the affine map that fits the known cells around it best, near ones more than
/// far ones; `None` where they do not tell.
pub(super) fn predict(cell: Cell, known: impl Fn(Cell) -> Option<DVec2>) -> Option<Place> {
    // Sums of weight times (1, u, v) (1, u, v) and times place.
    let mut n = [0.0f64; 6];
    let mut p = [DVec2::ZERO; 3];
    for dv in -AROUND..=AROUND {
        for du in -AROUND..=AROUND {
            if [du, dv] == [0, 0] {
                continue;
            }
            let Some(at) = known([cell[0] + du, cell[1] + dv]) else {
                continue;
            };
            let (u, v) = (f64::from(du), f64::from(dv));
            let w = 1.0 / (u * u + v * v).powi(2);
            for (sum, add) in n.iter_mut().zip([1.0, u, v, u * u, u * v, v * v]) {
                *sum += w * add;
            }
            for (sum, add) in p.iter_mut().zip([1.0, u, v]) {
                *sum += w * add * at;
            }
        }
    }
    let [s, u, v, uu, uv, vv] = n;
    let matrix = glam::DMat3::from_cols_array(&[s, u, v, u, uu, uv, v, uv, vv]);
    // Three dots that are no line have a determinant of about 1e-2 with the least of the weights.
    if !(matrix.determinant() > 1e-6) {
        return None;
    }
    let inverse = matrix.inverse();
    let solve = |row: usize| {
        let r = inverse.row(row);
        r.x * p[0] + r.y * p[1] + r.z * p[2]
    };
    let place = Place {
        at: solve(0),
        basis: DMat2::from_cols(solve(1), solve(2)),
    };
    (place.at.is_finite() && place.basis.determinant() > 0.0).then_some(place)
}

/// The median of what is known of the cells around a cell.
pub(super) fn typical(cell: Cell, known: impl Fn(Cell) -> Option<f64>) -> Option<f64> {
    let mut values: Vec<f64> = (-AROUND..=AROUND)
        .flat_map(|dv| (-AROUND..=AROUND).map(move |du| [du, dv]))
        .filter(|&d| d != [0, 0])
        .filter_map(|[du, dv]| known([cell[0] + du, cell[1] + dv]))
        .collect();
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}
