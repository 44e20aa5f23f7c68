//! An image pattern, prepared for averages over footprints.

use super::row_table::WIDEST;

/// Inverse of the maximum slant of a part of a footprint, in pattern pixels. A footprint is divided
/// into at most 8 by 8 parts.
const PARTS_PER_PX: f32 = 2.0;
const MOST_PARTS: usize = 8;

/// Summed-area table of an image, with (width + 1) x (height + 1) corners.
pub(crate) struct ImageTable {
    width: usize,
    height: usize,
    sums: Vec<f64>,
    scale: f32,
}

impl ImageTable {
    pub(super) fn new(width: usize, height: usize, levels: &[u16], scale: f32) -> Self {
        let stride = width + 1;
        let mut sums = vec![0.0; stride * (height + 1)];
        for y in 0..height {
            let mut row = 0.0;
            for x in 0..width {
                row += f64::from(levels[y * width + x]);
                sums[(y + 1) * stride + x + 1] = sums[y * stride + x + 1] + row;
            }
        }
        Self {
            width,
            height,
            sums,
            scale,
        }
    }

    /// Returns the average level, 0 to 1, over a parallelogram footprint. The footprint is divided
    /// into enough parts to follow its slant, and each part is replaced by the rectangle with the
    /// same second moments.
    ///
    /// A blur with standard deviations `blur` along columns and rows is added to the second moments
    /// of each part. This approximation preserves the mean and width of the part but not the shape
    /// of the Gaussian.
    pub(super) fn average(
        &self,
        [x, y]: [f32; 2],
        x_slope: [f32; 2],
        y_slope: [f32; 2],
        blur: [f32; 2],
    ) -> f32 {
        let lesser = |s: [f32; 2]| s[0].abs().min(s[1].abs());
        let slant = lesser(x_slope).max(lesser(y_slope));
        // A slant of NaN counts as no slant.
        let parts = ((slant * PARTS_PER_PX).ceil() as usize).clamp(1, MOST_PARTS);
        let narrow = 1.0 / parts as f32;
        // A box with the same variance as a Gaussian is sqrt(12) of its standard deviations wide.
        let width = |s: [f32; 2], blur: f32| {
            let part = s[0].hypot(s[1]) * narrow;
            f64::from(part.hypot(blur * 12f32.sqrt()).clamp(1e-3, WIDEST))
        };
        let size = (width(x_slope, blur[0]), width(y_slope, blur[1]));
        let mut sum = 0.0;
        for k in 0..parts * parts {
            let along = |k: usize| (k as f32 + 0.5) * narrow - 0.5;
            let (u, v) = (along(k % parts), along(k / parts));
            let at = (
                x + u * x_slope[0] + v * x_slope[1],
                y + u * y_slope[0] + v * y_slope[1],
            );
            sum += self.rectangle(at, size);
        }
        (sum / (parts * parts) as f64) as f32 * self.scale
    }

    /// Returns the mean level over a rectangle centred on a position.
    fn rectangle(&self, (x, y): (f32, f32), (w, h): (f64, f64)) -> f64 {
        // Converts positions relative to pixel centres to positions relative to table corners.
        let (x, y) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
        let clip = |low: f64, high: f64, end: usize| {
            let end = end as f64;
            let low = low.clamp(0.0, end - 1e-3);
            (low, high.clamp(low + 1e-3, end))
        };
        let (x0, x1) = clip(x - w / 2.0, x + w / 2.0, self.width);
        let (y0, y1) = clip(y - h / 2.0, y + h / 2.0, self.height);
        let total = self.sum(x1, y1) - self.sum(x0, y1) - self.sum(x1, y0) + self.sum(x0, y0);
        total / ((x1 - x0) * (y1 - y0))
    }

    /// Returns the integral of the levels from the image corner to a point; bilinear interpolation
    /// is exact because levels are constant within a pixel.
    fn sum(&self, x: f64, y: f64) -> f64 {
        let (i, j) = (
            (x as usize).min(self.width - 1),
            (y as usize).min(self.height - 1),
        );
        let (s, t) = (x - i as f64, y - j as f64);
        let stride = self.width + 1;
        let row = |j: usize| {
            let at = j * stride + i;
            self.sums[at] + s * (self.sums[at + 1] - self.sums[at])
        };
        row(j) + t * (row(j + 1) - row(j))
    }

    /// Returns the memory size of the table in bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.sums.as_slice())
    }

    /// Returns the columns and rows of the image.
    pub(crate) fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Returns the sums at the corners, row by row. They are integers, which f64 represents exactly.
    pub(crate) fn sums(&self) -> &[f64] {
        &self.sums
    }

    /// Returns the light, relative to full white, per unit of the levels.
    pub(crate) fn scale(&self) -> f32 {
        self.scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the mean level over a parallelogram footprint, from 300 x 300 samples.
    fn sampled(levels: &[u16], at: [f32; 2], x_slope: [f32; 2], y_slope: [f32; 2]) -> f64 {
        let n = 300;
        let mut sum = 0.0;
        for k in 0..n * n {
            let along = |k: usize| (k as f32 + 0.5) / n as f32 - 0.5;
            let (u, v) = (along(k % n), along(k / n));
            let x = at[0] + u * x_slope[0] + v * x_slope[1];
            let y = at[1] + u * y_slope[0] + v * y_slope[1];
            sum += f64::from(levels[y.round() as usize * 64 + x.round() as usize]);
        }
        sum / (n * n) as f64
    }

    #[test]
    fn slanted_footprints_are_followed() {
        let levels: Vec<u16> = (0..64 * 64u32)
            .map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u16)
            .collect();
        let table = ImageTable::new(64, 64, &levels, 1.0 / 255.0);
        for (x_slope, y_slope, bar) in [
            ([4.35, 0.0], [0.0, 4.35], 0.5),
            ([4.35, 0.2], [0.1, 4.35], 3.0),
            ([3.0, 3.0], [-3.0, 3.0], 3.0),
            ([8.0, 2.0], [1.0, 6.0], 4.0),
        ] {
            for i in 0..100u16 {
                let at = [
                    16.0 + f32::from(i % 10) * 3.17,
                    17.0 + f32::from(i / 10) * 3.03,
                ];
                let fast = 255.0 * f64::from(table.average(at, x_slope, y_slope, [0.0; 2]));
                let error = (fast - sampled(&levels, at, x_slope, y_slope)).abs();
                assert!(error < bar, "{at:?} {x_slope:?} {y_slope:?}: {error}");
            }
        }
    }
}
