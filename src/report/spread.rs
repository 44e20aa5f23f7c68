//! Quartiles of repeated measurements.

/// Median and quartiles of repeated measurements, in the unit of the measurements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// First quartile.
    pub low: f64,
    /// Median.
    pub median: f64,
    /// Third quartile.
    pub high: f64,
}

impl Spread {
    /// Computes the quartiles of measurements in any order; NaN without measurements.
    pub fn new(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let [low, median, high] = [0.25, 0.5, 0.75].map(|share| quantile(&values, share));
        Self { low, median, high }
    }

    /// Returns the quartiles times a factor, to change the unit.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        let Self { low, median, high } = self;
        let [low, median, high] = [low, median, high].map(|value| value * factor);
        Self { low, median, high }
    }
}

/// Returns the quantile `share` (0 to 1) of sorted values, linear between neighbours (Hyndman and Fan
/// 1996, definition 7); NaN without values.
pub fn quantile(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else {
        return f64::NAN;
    };
    let place = share.clamp(0.0, 1.0) * last as f64;
    let (below, above) = (place.floor() as usize, place.ceil() as usize);
    let part = place - place.floor();
    sorted[below] + part * (sorted[above] - sorted[below])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_lie_between_neighbours() {
        let spread = Spread::new(vec![5.0, 1.0, 4.0, 2.0, 3.0]);
        let three = |low, median, high| Spread { low, median, high };
        assert_eq!(spread, three(2.0, 3.0, 4.0));
        assert_eq!(Spread::new(vec![2.0, 1.0]), three(1.25, 1.5, 1.75));
        assert_eq!(Spread::new(vec![7.0]).times(2.0), three(14.0, 14.0, 14.0));
        assert!(Spread::new(vec![]).median.is_nan());
        assert!((quantile(&[0.0, 10.0], 0.99) - 9.9).abs() < 1e-12);
    }
}
