//! Arranges blobs into grids, stores the dots of the board's grid, and predicts a dot from its
//! neighbours.
//!
//! A dot's own ellipse shows how its surroundings are foreshortened: in the metric that makes the
//! ellipse a circle, the four nearest dots lie at equal distances and right angles, which separates
//! them from the diagonal ones at any tilt. A dot with all eight neighbours at their expected
//! positions is a seed. The grid grows from it, with each position predicted by an affine map
//! fitted to the dots already placed around it. The prediction is off by a few percent of a pitch,
//! because an affine map neglects perspective and distortion.

use super::find::{Blob, Ellipse};
use super::fit::Fit;
use glam::{DMat2, DVec2};
use phasmid_core::statistics::finite_median;
use phasmid_geometry::Board;
use std::collections::{BTreeMap, VecDeque};

/// Column and row in a grid's own numbering.
pub(super) type Cell = [i32; 2];

/// Search radius for a blob's neighbours, in semi-axes; a grid's pitch is about 5 dot radii.
const FAR: f64 = 14.0;
/// Maximum distance of a seed's neighbours from a regular grid, in pitches.
const SEED: f64 = 0.2;
/// Maximum distance of a dot from its predicted position, in pitches.
const STRAY: f64 = 0.25;
/// Allowed ratio of a dot's area to the area of the dots around it.
const SIZES: std::ops::Range<f64> = 0.2..9.0;
/// Radius, in cells, of the neighbourhood that predicts a cell's position.
const AROUND: i32 = 2;
/// Maximum number of grids that are grown.
const TRIES: usize = 64;

/// Blob indices by cell.
pub(super) type Grid = BTreeMap<Cell, usize>;

/// Blobs sorted by x, so that the blobs near a position are found quickly.
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

    /// Blobs whose x and y are within `reach` of a position.
    fn near(&self, place: DVec2, reach: DVec2) -> impl Iterator<Item = usize> + '_ {
        let first = self.by_x.partition_point(|&(x, _)| x < place.x - reach.x);
        self.by_x[first..]
            .iter()
            .take_while(move |&&(x, _)| x <= place.x + reach.x)
            .map(|&(_, k)| k)
            .filter(move |&k| (self.blobs[k].ellipse.centre.y - place.y).abs() <= reach.y)
    }
}

/// Finds grids among the blobs, the largest first. No blob belongs to two grids.
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

/// Nine blobs that form a 3 x 3 grid.
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
    // Keep the nearest 24 blobs: eight neighbours, and up to 16 blobs that are not dots.
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
    // The grid's y axis is clockwise of its x axis in the image, as on the board.
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

/// Predicted position of a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    /// In pixels.
    pub at: DVec2,
    /// Steps to the next column and to the next row, in pixels.
    pub basis: DMat2,
}

/// Predicts a cell's position by an affine map fitted to the known cells around it, with weights
/// that fall with distance; `None` if those cells do not determine the map.
pub(super) fn predict(cell: Cell, known: impl Fn(Cell) -> Option<DVec2>) -> Option<Place> {
    // Weighted sums of (1, u, v)^T (1, u, v) and of (1, u, v) times position.
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
    // The determinant is at least 2.5e-5 if three cells of the neighbourhood are not collinear.
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

/// Median of the known values of the cells around a cell.
pub(super) fn typical(cell: Cell, known: impl Fn(Cell) -> Option<f64>) -> Option<f64> {
    let values = (-AROUND..=AROUND)
        .flat_map(|dv| (-AROUND..=AROUND).map(move |du| [du, dv]))
        .filter(|&d| d != [0, 0])
        .filter_map(|[du, dv]| known([cell[0] + du, cell[1] + dv]));
    finite_median(values)
}

/// A dot found so far.
#[derive(Debug, Clone)]
pub(super) struct Dot {
    /// Initial outline, from the blob or the neighbours.
    pub start: Ellipse,
    /// Fitted outline; `None` if not fitted yet or if the fit failed.
    pub fit: Option<Fit>,
}

impl Dot {
    /// The fitted outline if there is one, else the initial one.
    pub fn ellipse(&self) -> Ellipse {
        self.fit
            .as_ref()
            .map_or(self.start, |fit| fit.model.ellipse)
    }
}

/// All dots found so far.
#[derive(Debug, Clone)]
pub(super) struct Dots<'a> {
    pub board: &'a Board,
    pub known: BTreeMap<Cell, Dot>,
}

impl Dots<'_> {
    /// Returns the board index of a cell, or `None` if the cell is outside the board.
    pub fn index(&self, cell: Cell) -> Option<[u32; 2]> {
        index(self.board, cell)
    }

    fn radius_mm(&self, cell: Cell) -> Option<f64> {
        self.index(cell).map(|index| self.board.radius_mm(index))
    }

    /// Predicts a dot's position from the dots around it.
    pub fn place(&self, cell: Cell) -> Option<Place> {
        predict(cell, |c| self.known.get(&c).map(|dot| dot.ellipse().centre))
    }

    /// Predicts a dot's outline about `centre`: the mean of the dots around it, scaled to its
    /// radius.
    pub fn outline(&self, cell: Cell, centre: DVec2) -> Option<Ellipse> {
        let radius = self.radius_mm(cell)?;
        let (mut sum, mut count) = (DMat2::ZERO, 0.0);
        let fitted = self.around(cell, 2).any(|(_, dot)| dot.fit.is_some());
        for (c, dot) in self.around(cell, 2) {
            // Use only measured dots if there are any.
            if fitted && dot.fit.is_none() {
                continue;
            }
            let theirs = self.radius_mm(c)?;
            sum += dot.ellipse().shape * (radius / theirs);
            count += 1.0;
        }
        (count > 0.0).then(|| Ellipse {
            centre,
            shape: sum * (1.0 / count),
        })
    }

    /// Known dots within `steps` cells of a cell, except the dot of that cell.
    pub fn around(&self, [u, v]: Cell, steps: i32) -> impl Iterator<Item = (Cell, &Dot)> {
        (v - steps..=v + steps)
            .flat_map(move |row| (u - steps..=u + steps).map(move |column| [column, row]))
            .filter(move |&cell| cell != [u, v])
            .filter_map(|cell| self.known.get(&cell).map(|dot| (cell, dot)))
    }
}

/// Returns the board index of a cell, or `None` if the cell is outside the board.
pub(super) fn index(board: &Board, [column, row]: Cell) -> Option<[u32; 2]> {
    let index = [u32::try_from(column).ok()?, u32::try_from(row).ok()?];
    let [columns, rows] = board.grid();
    (index[0] < columns && index[1] < rows).then_some(index)
}
