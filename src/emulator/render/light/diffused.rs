//! Pictures on skin.
//!
//! Each Gaussian of the spread counts as the picture's own blur does, a box of its variance along
//! column and row: mean and widths are kept, and the shape of their sum is close to the spread's.

use super::super::buffer::{GeometryBuffer, Mixed};
use super::super::skin::SkinMaps;
use super::blend::Spread;
use super::picture_table::PictureTable;

/// Does again what the exposure pass did, for the pixels that see lit skin.
pub(super) fn pixels(
    map: &GeometryBuffer,
    skin: &SkinMaps,
    picture: &PictureTable,
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
                blur: map.blur.get(i).copied().unwrap_or(0.0),
            };
            let level = footprint.average(picture, [x, y]);
            *e = seconds * (map.ambient[i] + light * map.projected[i] * level);
        }
    }
}

/// The same for the samples of a mixed pixel.
pub(super) fn samples(
    skin: &SkinMaps,
    picture: &PictureTable,
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
                blur: mixed.blur[k],
            };
            *level = footprint.average(picture, [x, y]);
        }
    }
}

struct Footprint {
    at: [f32; 2],
    slopes: [[f32; 2]; 2],
    blur: f32,
}

impl Footprint {
    fn average(&self, picture: &PictureTable, spread: [Spread<'_>; 2]) -> f32 {
        let components = spread[0].mixture.components();
        let level = |c: &super::super::skin::Component| {
            let sigma = spread.map(|s| (c.sigma_mm as f32 * s.px_per_mm).hypot(self.blur));
            let [x, y] = self.slopes;
            c.weight as f32 * picture.average(self.at, x, y, sigma)
        };
        components.iter().map(level).sum()
    }
}
