//! Exposes skin to pattern images that vary along both axes.
//!
//! A normal distribution is a mixture of uniform distributions whose squared half widths follow a
//! chi-square distribution with three degrees of freedom. Three uniform distributions, chosen by
//! Gauss-Laguerre quadrature, match the moments of the normal distribution up to the eleventh. Each
//! Gaussian of the spread is therefore replaced by three squares on the image, and the table gives
//! the mean level of each square. Along columns and rows this is accurate to about 4 of 255 levels
//! for a fringe and 7 for Gray code; along diagonals it is coarser.

use super::super::skin::Component;
use super::blend::Spread;
use super::buffer::{GeometryBuffer, Mixed};
use super::image_table::ImageTable;
use super::skin_maps::SkinMaps;

/// For each of the three squares: its weight, and its squared half width divided by the variance.
const SQUARES: [(f32, f32); 3] = [
    (0.640_001_2, 1.332_651_8),
    (0.344_575_14, 5.601_55),
    (0.015_423_678, 14.065_798),
];

/// Replaces the exposure of the pixels that see lit skin.
pub(super) fn pixels(
    map: &GeometryBuffer,
    skin: &SkinMaps,
    image: &ImageTable,
    [seconds, light]: [f32; 2],
    first: usize,
    electrons: &mut [f32],
) {
    for (k, e) in electrons.iter_mut().enumerate() {
        let i = first + k;
        if let (Some(x), Some(y)) = (skin.spread(i, 0), skin.spread(i, 1)) {
            let footprint = Footprint {
                at: [skin.from[0][i], skin.from[1][i]],
                slopes: [map.x_slope[i], map.y_slope[i]],
                blur: map.blur_along(map.blur.get(i).copied().unwrap_or(0.0)),
            };
            let level = footprint.average(image, [x, y]);
            *e = seconds * (map.ambient[i] + light * map.projected[i] * level);
        }
    }
}

/// Same as [`pixels`], for the samples of a mixed pixel.
pub(super) fn samples(
    map: &GeometryBuffer,
    skin: &SkinMaps,
    image: &ImageTable,
    mixed: &Mixed,
    levels: &mut [f32; 16],
) {
    let Some(samples) = &mixed.skin else { return };
    for (k, level) in levels.iter_mut().enumerate() {
        let spread = [0, 1].map(|axis| skin.sample(samples, k, axis));
        if let [Some(x), Some(y)] = spread {
            let footprint = Footprint {
                at: [mixed.x[k], mixed.y[k]],
                slopes: [mixed.x_slope[k], mixed.y_slope[k]],
                blur: map.blur_along(mixed.blur[k]),
            };
            *level = footprint.average(image, [x, y]);
        }
    }
}

struct Footprint {
    at: [f32; 2],
    slopes: [[f32; 2]; 2],
    blur: [f32; 2],
}

impl Footprint {
    fn average(&self, image: &ImageTable, spread: [Spread<'_>; 2]) -> f32 {
        let components = spread[0].mixture.components();
        let [x, y] = self.slopes;
        let level = |c: &Component| {
            let sigma: [f32; 2] = std::array::from_fn(|axis| {
                (c.sigma_mm as f32 * spread[axis].px_per_mm).hypot(self.blur[axis])
            });
            let square = |(weight, width): (f32, f32)| {
                // `average` expects a standard deviation; the standard deviation of a box of half
                // width h is h / sqrt(3).
                let blur = sigma.map(|sigma| sigma * (width / 3.0).sqrt());
                weight * image.average(self.at, x, y, blur)
            };
            c.weight as f32 * SQUARES.into_iter().map(square).sum::<f32>()
        };
        components.iter().map(level).sum()
    }
}
