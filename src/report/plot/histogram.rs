//! Histograms, drawn as densities.

use super::{Panel, Sheet};
use glam::DVec2;

/// Counts of values in bins of equal width.
#[derive(Debug, Clone, PartialEq)]
pub struct Histogram {
    /// Start of the first bin.
    pub low: f64,
    /// Width of a bin.
    pub width: f64,
    /// Number of values in each bin; a bin includes its lower end.
    pub counts: Vec<usize>,
    /// Numbers of values below and above all bins.
    pub outside: [usize; 2],
}

impl Histogram {
    /// Counts finite values in `bins` bins (1 to 1000) from `low` to `high`.
    pub fn new(values: impl IntoIterator<Item = f64>, low: f64, high: f64, bins: usize) -> Self {
        let bins = bins.clamp(1, 1000);
        let width = (high - low) / bins as f64;
        let mut found = Self {
            low,
            width,
            counts: vec![0; bins],
            outside: [0; 2],
        };
        for value in values.into_iter().filter(|v| v.is_finite()) {
            let bin = ((value - low) / width).floor();
            if bin < 0.0 {
                found.outside[0] += 1;
            } else if bin < bins as f64 {
                found.counts[bin as usize] += 1;
            } else {
                found.outside[1] += 1;
            }
        }
        found
    }

    /// Returns the number of counted values, including those outside the bins.
    pub fn total(&self) -> usize {
        self.counts.iter().chain(&self.outside).sum()
    }

    /// Returns the density of each bin: its fraction of all values divided by its width.
    pub fn densities(&self) -> Vec<f64> {
        let unit = self.total().max(1) as f64 * self.width;
        self.counts.iter().map(|n| *n as f64 / unit).collect()
    }

    /// Draws the densities as bars in a panel whose y axis is a density.
    pub fn draw(&self, sheet: &mut Sheet, panel: &Panel, class: &str) {
        for (i, density) in self.densities().into_iter().enumerate() {
            let from = self.low + i as f64 * self.width;
            let corners = (
                panel.at(DVec2::new(from, density)),
                panel.at(DVec2::new(from + self.width, 0.0)),
            );
            if let (Some(a), Some(b)) = corners {
                let tip = format!(
                    "{} in [{from:.3}, {:.3})",
                    self.counts[i],
                    from + self.width
                );
                // Leaves a thin gap between bars.
                let size = b - a - DVec2::new(0.6, 0.0);
                sheet.rect(&format!("fill {class}"), a, size, Some(&tip));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::Axis;

    #[test]
    fn every_finite_value_is_counted_once() {
        let values = [
            -3.0,
            -1.0,
            -0.5,
            0.0,
            0.99,
            1.0,
            7.0,
            f64::NAN,
            f64::INFINITY,
        ];
        let found = Histogram::new(values, -1.0, 1.0, 2);
        assert_eq!(found.counts, [2, 2]);
        assert_eq!(found.outside, [1, 2]);
        assert_eq!(found.total(), 7);
        let inside: f64 = found.densities().iter().map(|d| d * found.width).sum();
        assert!((inside - 4.0 / 7.0).abs() < 1e-15);
    }

    #[test]
    fn bars_have_the_densities_for_heights() {
        let found = Histogram::new([0.1, 0.2, 0.6], 0.0, 1.0, 2);
        let panel = Panel {
            corner: DVec2::ZERO,
            size: DVec2::new(100.0, 200.0),
            x: Axis::between("", 0.0, 1.0),
            y: Axis::between("", 0.0, 2.0),
        };
        let mut sheet = Sheet::new(100.0, 200.0);
        found.draw(&mut sheet, &panel, "c0");
        let text = sheet.into_element("");
        // 2 of 3 values in half the range: density 4/3, two thirds of the panel's height.
        assert!(text.contains("height=\"133.33\""), "{text}");
        assert!(text.contains("height=\"66.67\""), "{text}");
    }

    #[test]
    fn empty_or_invalid_data_do_not_panic() {
        assert_eq!(Histogram::new([], 0.0, 1.0, 4).densities(), [0.0; 4]);
        let odd = Histogram::new([1.0], f64::NAN, 1.0, 4);
        assert_eq!(odd.total(), 1);
    }
}
