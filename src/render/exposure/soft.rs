//! A footprint's trapezoid convolved with a Gaussian blur.

use super::bell::Bell;

/// The convolution of two boxes and a Gaussian, along one axis of the pattern image.
#[derive(Clone, Copy)]
pub(crate) struct Soft<'a> {
    bell: &'a Bell,
    sigma: f64,
    wide: f64,
    narrow: f64,
}

impl<'a> Soft<'a> {
    /// Creates the convolution of boxes of widths |`slope`| and a Gaussian with a standard deviation
    /// above 0, all in projector pixels.
    pub(crate) fn new(bell: &'a Bell, slope: [f64; 2], sigma: f64) -> Self {
        let [a, b] = slope.map(f64::abs);
        // A box much narrower than the blur has no effect but would cause cancellation.
        let wide = a.max(b).max(1e-3 * sigma);
        let narrow = a.min(b).max(1e-3 * sigma).max(1e-6 * wide).min(wide);
        Self {
            bell,
            sigma,
            wide,
            narrow,
        }
    }

    /// Returns half the base width of the sharp trapezoid.
    pub(super) fn outer(&self) -> f64 {
        (self.wide + self.narrow) / 2.0
    }

    /// Returns the fraction left of a border at distance e from the centre.
    pub(crate) fn left_of(&self, e: f64) -> f64 {
        let second = self.second_difference(e, |e| self.bell.at(e / self.sigma));
        second * self.sigma * self.sigma
    }

    /// Returns the same fraction for the sharp trapezoid.
    pub(crate) fn sharp_left_of(&self, e: f64) -> f64 {
        self.second_difference(e, |e| 0.5 * e.max(0.0).powi(2))
    }

    fn second_difference(&self, e: f64, q: impl Fn(f64) -> f64) -> f64 {
        let (outer, inner) = (self.outer(), (self.wide - self.narrow) / 2.0);
        let second = (q(e + outer) - q(e + inner)) - (q(e - inner) - q(e - outer));
        second / (self.wide * self.narrow)
    }
}
