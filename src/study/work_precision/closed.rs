//! The closed form of a pixel's footprint in f64: a row of held pixels is averaged under the trapezoid
//! that a pixel's column and row form together, by second differences of its second integral. The fast
//! path does this in f32; a comparison of the two separates rounding from the model's own error.

use glam::DVec2;
use phasmid_pattern::Axis;
use phasmid_render::pattern_image::PatternImage;
use phasmid_render::reference::Reference;

/// Step of the finite differences, as a fraction of a pixel.
const STEP: f64 = 0.25;

/// Position of a pixel's centre on the pattern image's x axis, and the extent of its column and row.
#[derive(Debug, Clone, Copy)]
pub struct Footprint {
    x: f64,
    reach: [f64; 2],
}

impl Footprint {
    /// Computes the footprint of a pixel whose rays see one smooth surface; `None` if one of them
    /// leaves the scene.
    pub fn new(reference: &Reference, px: DVec2) -> Option<Self> {
        let at = |offset: DVec2| Some(reference.trace(px + offset)?.projector_px.x);
        let along = |axis: DVec2| Some((at(axis * STEP)? - at(-axis * STEP)?) / (2.0 * STEP));
        Some(Self {
            x: at(DVec2::ZERO)?,
            reach: [along(DVec2::X)?, along(DVec2::Y)?].map(f64::abs),
        })
    }

    /// Creates a footprint at a position of the pattern image, in projector pixels.
    #[cfg(test)]
    pub fn at(x: f64, reach: [f64; 2]) -> Self {
        Self { x, reach }
    }

    /// Returns the position of the centre on the pattern image's x axis, in projector pixels.
    pub fn x(&self) -> f64 {
        self.x
    }

    /// Returns the extent of column and row along this axis, in projector pixels.
    pub fn reach(&self) -> [f64; 2] {
        self.reach
    }

    /// Returns the mean level under the footprint.
    pub fn mean(&self, row: &Integral) -> f64 {
        let [a, b] = self.reach;
        let (far, near) = ((a + b) / 2.0, (a - b) / 2.0);
        let second = |x: f64| row.second(self.x + x);
        if a * b < 1e-9 {
            // If one side is zero, the trapezoid is a box.
            return (row.first(self.x + far) - row.first(self.x - far)) / (2.0 * far);
        }
        (second(far) - second(near) - second(-near) + second(-far)) / (a * b)
    }
}

/// The first and the second integral of a row of held pixels from its left edge.
pub struct Integral {
    levels: Vec<f64>,
    first: Vec<f64>,
    second: Vec<f64>,
}

impl Integral {
    /// Integrates a pattern image that varies along x; `None` for any other image.
    pub fn new(pattern_image: &PatternImage) -> Option<Self> {
        let PatternImage::Row(Axis::X, row) = pattern_image else {
            return None;
        };
        let levels: Vec<f64> = row.iter().map(|level| f64::from(*level)).collect();
        let (mut first, mut second) = (vec![0.0], vec![0.0]);
        for (i, level) in levels.iter().enumerate() {
            second.push(second[i] + first[i] + level / 2.0);
            first.push(first[i] + level);
        }
        Some(Self {
            levels,
            first,
            second,
        })
    }

    /// Returns the held pixel that contains a coordinate, and the position within it.
    fn place(&self, x: f64) -> (usize, f64) {
        let x = (x + 0.5).clamp(0.0, self.levels.len() as f64);
        let i = (x.floor() as usize).min(self.levels.len() - 1);
        (i, x - i as f64)
    }

    fn first(&self, x: f64) -> f64 {
        let (i, inside) = self.place(x);
        self.levels[i].mul_add(inside, self.first[i])
    }

    fn second(&self, x: f64) -> f64 {
        let (i, inside) = self.place(x);
        self.second[i] + inside * (self.first[i] + self.levels[i] * inside / 2.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_those_of_many_places() {
        let row: Vec<u16> = (0..40).map(|i| (i * 37 % 101) as u16).collect();
        let integral = Integral::new(&PatternImage::Row(Axis::X, row.clone())).unwrap();
        for reach in [[4.35, 0.7], [0.7, 4.35], [3.0, 0.0]] {
            let footprint = Footprint { x: 20.3, reach };
            let n = 2000;
            let share = |i: usize| (i as f64 + 0.5) / n as f64 - 0.5;
            let places = (0..n).flat_map(|i| (0..n).map(move |j| [share(i), share(j)]));
            let sum: f64 = places
                .map(|[u, v]| f64::from(row[(20.8 + reach[0] * u + reach[1] * v) as usize]))
                .sum();
            let mean = sum / (n * n) as f64;
            let found = footprint.mean(&integral);
            // At steps between pixels of the row, sampling is accurate to half of the spacing of
            // the samples.
            assert!((found - mean).abs() < 0.03, "{found} {mean}");
        }
        assert!(Integral::new(&PatternImage::Uniform(3)).is_none());
    }
}
