//! Gather points of indirect light, and their interpolation weights for each pixel.

use crate::exposure::GeometryBuffer;
use crate::transport::rays::Rays;
use crate::truth::Truth;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Minimum cosine of the angle (20 degrees) between two normals of one smooth surface within a grid
/// cell.
const COS_BENT: f64 = 0.939_692_620_785_908_4;
/// Maximum distance of a grid point from a pixel's tangent plane, relative to the grid point's
/// distance from the pixel's point.
const OFF_PLANE: f64 = 0.2;
/// Minimum sum of the bilinear weights of the usable grid points; a pixel with a smaller sum becomes
/// a gather point itself.
const LEAST: f64 = 0.2;

/// Pixels at which light is gathered: the pixels of the grid, row by row, followed by pixels that
/// cannot be interpolated from the grid.
pub(super) struct Grid {
    /// Indices of these pixels; `None` for a grid pixel that sees no surface.
    pub(super) pixels: Vec<Option<usize>>,
    /// See the fields of the same names of [`InterreflectionMap`](super::InterreflectionMap).
    pub(super) first: Vec<u32>,
    pub(super) shares: Vec<[f32; 4]>,
    pub(super) stride: usize,
}

/// Surface point that a pixel's centre sees.
struct Seen {
    point: DVec3,
    normal: DVec3,
}

/// Position of a pixel in the grid along one axis: index of the grid point before it and fraction of
/// the way to the next grid point.
type Along = (usize, f64);

/// The grid of every `step`th column and row, and of the last column and row.
pub(super) struct Lattice {
    width: usize,
    columns: Vec<usize>,
    rows: Vec<usize>,
    across: Vec<Along>,
    down: Vec<Along>,
}

impl Lattice {
    /// Creates the grid on an image with this number of columns and rows.
    pub(super) fn new([width, height]: [usize; 2], step: usize) -> Self {
        let (columns, rows) = (places(width, step), places(height, step));
        Self {
            width,
            across: (0..width).map(|u| along(&columns, step, u)).collect(),
            down: (0..height).map(|v| along(&rows, step, v)).collect(),
            columns,
            rows,
        }
    }

    fn stride(&self) -> usize {
        self.columns.len()
    }

    /// Returns the pixels of the grid, row by row.
    pub(super) fn pixels(&self) -> Vec<usize> {
        let of_row = |row: &usize| {
            let from = row * self.width;
            self.columns.iter().map(move |column| from + column)
        };
        self.rows.iter().flat_map(of_row).collect()
    }

    /// Returns the index of the first of the four grid points around a pixel.
    fn first(&self, pixel: usize) -> usize {
        let (j, i) = (
            self.down[pixel / self.width].0,
            self.across[pixel % self.width].0,
        );
        j * self.stride() + i
    }

    /// Returns the first of the four grid points from which the light of a pixel of `map` is
    /// interpolated, and their shares. The light at the grid points is that of the surfaces that
    /// `corners` sees. There are no shares if hardly any of the points is on the pixel's surface;
    /// `None` if the pixel sees no surface.
    pub(super) fn place(
        &self,
        pixel: usize,
        map: &GeometryBuffer,
        corners: &GeometryBuffer,
        rays: &Rays<'_>,
    ) -> Option<(u32, Option<[f32; 4]>)> {
        let seen = Seen::at(map, rays, pixel)?;
        let (i, right) = self.across[pixel % self.width];
        let (j, down) = self.down[pixel / self.width];
        let even = [
            (1.0 - right) * (1.0 - down),
            right * (1.0 - down),
            (1.0 - right) * down,
            right * down,
        ];
        let mut kept = [0.0; 4];
        for k in (0..4).filter(|&k| even[k] > 0.0) {
            let corner = self.rows[j + k / 2] * self.width + self.columns[i + k % 2];
            let other = Seen::at(corners, rays, corner);
            if other.is_some_and(|other| seen.goes_on_to(&other)) {
                kept[k] = even[k];
            }
        }
        let sum: f64 = kept.iter().sum();
        let scale = f64::from(map.evenly[pixel]) / sum;
        let shares = (sum >= LEAST).then(|| kept.map(|k| (k * scale) as f32));
        Some((self.first(pixel) as u32, shares))
    }
}

impl Grid {
    /// Selects the gather points and their shares of each pixel; `step` is the spacing of the grid.
    pub(super) fn new(map: &GeometryBuffer, rays: &Rays<'_>, step: usize) -> Self {
        let lattice = Lattice::new([map.width, map.height], step);
        let seen = |pixel: usize| (map.flags[pixel] & Truth::SEEN != 0).then_some(pixel);
        let mut pixels: Vec<Option<usize>> = lattice.pixels().into_iter().map(seen).collect();
        let mut shares = vec![[0.0; 4]; map.flags.len()];
        let alone: Vec<Vec<usize>> = shares
            .par_chunks_mut(map.width)
            .enumerate()
            .map(|(v, shares)| {
                let mut alone = Vec::new();
                for (u, shares) in shares.iter_mut().enumerate() {
                    let pixel = v * map.width + u;
                    match lattice.place(pixel, map, map, rays) {
                        None => {}
                        Some((_, Some(found))) => *shares = found,
                        Some((_, None)) => {
                            alone.push(pixel);
                            *shares = [map.evenly[pixel], 0.0, 0.0, 0.0];
                        }
                    }
                }
                alone
            })
            .collect();
        let first = (0..map.flags.len()).map(|pixel| lattice.first(pixel) as u32);
        let mut first: Vec<u32> = first.collect();
        for pixel in alone.into_iter().flatten() {
            first[pixel] = pixels.len() as u32;
            pixels.push(Some(pixel));
        }
        Self {
            pixels,
            first,
            shares,
            stride: lattice.stride(),
        }
    }
}

/// Returns every `step`th of `count` indices, and the last index.
fn places(count: usize, step: usize) -> Vec<usize> {
    let mut places: Vec<usize> = (0..count).step_by(step).collect();
    if places.last() != Some(&(count - 1)) {
        places.push(count - 1);
    }
    places
}

fn along(places: &[usize], step: usize, at: usize) -> Along {
    let before = (at / step).min(places.len().saturating_sub(2));
    let Some(next) = places.get(before + 1) else {
        return (before, 0.0);
    };
    let from = places[before];
    (before, (at - from) as f64 / (next - from) as f64)
}

impl Seen {
    fn at(map: &GeometryBuffer, rays: &Rays<'_>, pixel: usize) -> Option<Self> {
        (map.flags[pixel] & Truth::SEEN != 0).then(|| Self {
            point: rays.center(pixel % map.width, pixel / map.width) * f64::from(map.depth[pixel]),
            normal: Vec3::from_array(map.normal[pixel]).as_dvec3(),
        })
    }

    /// Returns whether this point and another one are on one smooth surface.
    fn goes_on_to(&self, other: &Self) -> bool {
        let way = other.point - self.point;
        self.normal.dot(other.normal) >= COS_BENT
            && self.normal.dot(way).abs() <= OFF_PLANE * way.length()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_between_its_neighbours() {
        for (count, step) in [(8, 1), (9, 4), (10, 4), (8, 64), (13, 5)] {
            let places = places(count, step);
            assert_eq!((places[0], places[places.len() - 1]), (0, count - 1));
            for at in 0..count {
                let (before, on) = along(&places, step, at);
                assert!((0.0..=1.0).contains(&on), "{count} {step} {at}: {on}");
                let (from, to) = (places[before] as f64, places[before + 1] as f64);
                assert!((from + on * (to - from) - at as f64).abs() < 1e-12);
            }
        }
    }
}
