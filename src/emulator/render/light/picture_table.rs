//! A slide that is a picture, prepared for averaging over footprints.

use super::row_table::WIDEST;

/// A picture as a summed-area table of (width + 1) x (height + 1) corners.
pub(in super::super) struct PictureTable {
    width: usize,
    height: usize,
    sums: Vec<f64>,
    scale: f32,
}

impl PictureTable {
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

    /// Average level, 0 to 1, over the rectangle of the second moments of the footprint and of a
    /// blur with standard deviation `blur`: an approximation, which means and widths survive, but
    /// not the shape (a box of the same variance has sqrt(12) times the deviation for its width).
    pub(super) fn average(
        &self,
        [x, y]: [f32; 2],
        x_slope: [f32; 2],
        y_slope: [f32; 2],
        blur: f32,
    ) -> f32 {
        let blur = blur * 12f32.sqrt();
        let width = |s: [f32; 2]| f64::from(s[0].hypot(s[1]).hypot(blur).clamp(1e-3, WIDEST));
        let (w, h) = (width(x_slope), width(y_slope));
        // From pixel centres to corners of the table.
        let (x, y) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
        let clip = |low: f64, high: f64, end: usize| {
            let end = end as f64;
            let low = low.clamp(0.0, end - 1e-3);
            (low, high.clamp(low + 1e-3, end))
        };
        let (x0, x1) = clip(x - w / 2.0, x + w / 2.0, self.width);
        let (y0, y1) = clip(y - h / 2.0, y + h / 2.0, self.height);
        let total = self.sum(x1, y1) - self.sum(x0, y1) - self.sum(x1, y0) + self.sum(x0, y0);
        (total / ((x1 - x0) * (y1 - y0))) as f32 * self.scale
    }

    /// Integral from the picture's corner, bilinear between corners as held pixels have it.
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

    /// Memory that the table takes, in bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.sums.as_slice())
    }
}
