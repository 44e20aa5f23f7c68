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

impl Grid {
    /// Builds a grid of every `step`th column and row, and of the last column and row.
    pub(super) fn new(map: &GeometryBuffer, rays: &Rays<'_>, step: usize) -> Self {
        let (columns, rows) = (places(map.width, step), places(map.height, step));
        let stride = columns.len();
        let seen = |pixel: usize| (map.flags[pixel] & Truth::SEEN != 0).then_some(pixel);
        let mut pixels: Vec<Option<usize>> = rows
            .iter()
            .flat_map(|row| columns.iter().map(move |column| row * map.width + column))
            .map(seen)
            .collect();
        let across: Vec<Along> = (0..map.width).map(|u| along(&columns, step, u)).collect();
        let mut shares = vec![[0.0; 4]; map.flags.len()];
        let alone: Vec<Vec<usize>> = shares
            .par_chunks_mut(map.width)
            .enumerate()
            .map(|(v, shares)| {
                let (j, down) = along(&rows, step, v);
                let mut alone = Vec::new();
                for (u, shares) in shares.iter_mut().enumerate() {
                    let pixel = v * map.width + u;
                    let Some(seen) = Seen::at(map, rays, pixel) else {
                        continue;
                    };
                    let (i, right) = across[u];
                    let first = j * stride + i;
                    let corners = [first, first + 1, first + stride, first + stride + 1];
                    let even = [
                        (1.0 - right) * (1.0 - down),
                        right * (1.0 - down),
                        (1.0 - right) * down,
                        right * down,
                    ];
                    let mut kept = [0.0; 4];
                    for k in (0..4).filter(|&k| even[k] > 0.0) {
                        let corner = pixels[corners[k]];
                        let other = corner.and_then(|corner| Seen::at(map, rays, corner));
                        if other.is_some_and(|other| seen.goes_on_to(&other)) {
                            kept[k] = even[k];
                        }
                    }
                    let sum: f64 = kept.iter().sum();
                    if sum < LEAST {
                        alone.push(pixel);
                        *shares = [map.evenly[pixel], 0.0, 0.0, 0.0];
                    } else {
                        let scale = f64::from(map.evenly[pixel]) / sum;
                        *shares = kept.map(|k| (k * scale) as f32);
                    }
                }
                alone
            })
            .collect();
        let mut first = Vec::with_capacity(map.flags.len());
        for v in 0..map.height {
            let row = along(&rows, step, v).0 * stride;
            first.extend(across.iter().map(|(i, _)| (row + i) as u32));
        }
        for pixel in alone.into_iter().flatten() {
            first[pixel] = pixels.len() as u32;
            pixels.push(Some(pixel));
        }
        Self {
            pixels,
            first,
            shares,
            stride,
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
