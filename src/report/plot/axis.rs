//! An axis: maps values to the unit interval.

use super::ticks;

/// Scale of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Linear.
    Linear,
    /// Logarithmic: positive values only.
    Log,
}

/// A range of values with a label.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    low: f64,
    high: f64,
    scale: Scale,
    label: String,
    reversed: bool,
}

impl Axis {
    /// Makes an axis from `low` to `high`, or from 0 to 1 if they are not a valid range.
    pub fn between(label: &str, low: f64, high: f64) -> Self {
        // The difference must be finite as well: the difference of two huge numbers may overflow.
        let fits = (high - low).is_finite() && high > low;
        let (low, high) = if fits { (low, high) } else { (0.0, 1.0) };
        Self {
            low,
            high,
            scale: Scale::Linear,
            label: label.to_owned(),
            reversed: false,
        }
    }

    /// Makes an axis around the finite values with a small margin, or from 0 to 1 if all are 0.
    pub fn around(label: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let (low, high) = extent(values.into_iter()).unwrap_or((0.0, 1.0));
        if low == 0.0 && high == 0.0 {
            return Self::between(label, 0.0, 1.0);
        }
        let room = if high > low {
            0.04 * (high - low)
        } else {
            0.5 * low.abs()
        };
        Self::between(label, low - room, high + room)
    }

    /// Makes an axis from zero to just above the largest finite value, for bars.
    pub fn from_zero(label: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let high = extent(values.into_iter()).map_or(0.0, |(_, high)| high);
        Self::between(label, 0.0, 1.06 * high)
    }

    /// Makes a logarithmic axis around the finite positive values.
    pub fn logarithmic(label: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let positive = values.into_iter().filter(|v| *v >= f64::MIN_POSITIVE);
        let (low, high) = extent(positive).unwrap_or((1.0, 10.0));
        // A margin of half an octave on either side; both ends stay finite and positive.
        let (low, high) = (
            (low / 1.4).max(f64::MIN_POSITIVE),
            (high * 1.4).min(f64::MAX),
        );
        Self {
            low,
            high,
            scale: Scale::Log,
            label: label.to_owned(),
            reversed: false,
        }
    }

    /// Reverses the axis, as for the rows of an image, which count downwards.
    #[must_use]
    pub fn reversed(mut self) -> Self {
        self.reversed = !self.reversed;
        self
    }

    /// Returns the smallest and the largest value on the axis.
    pub fn range(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    /// Returns the axis' label, with the unit.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// Returns the position of a value: 0 at the start of the axis and 1 at its end, and less than 0 or
    /// more than 1 for values outside. `None` if the value is not finite, or not positive on a
    /// logarithmic axis.
    pub fn at(&self, value: f64) -> Option<f64> {
        let t = match self.scale {
            Scale::Linear => (value - self.low) / (self.high - self.low),
            Scale::Log if value > 0.0 => {
                (value.ln() - self.low.ln()) / (self.high.ln() - self.low.ln())
            }
            Scale::Log => return None,
        };
        let t = if self.reversed { 1.0 - t } else { t };
        t.is_finite().then_some(t)
    }

    /// Returns about `most` round numbers on the axis, with their labels.
    pub fn ticks(&self, most: usize) -> Vec<(f64, String)> {
        match self.scale {
            Scale::Linear => ticks::linear(self.low, self.high, most),
            Scale::Log => ticks::logarithmic(self.low, self.high),
        }
    }
}

/// Returns the smallest and the largest finite value; `None` if no value is finite.
fn extent(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.filter(|v| v.is_finite()).fold(None, |found, v| {
        Some(found.map_or((v, v), |(low, high): (f64, f64)| (low.min(v), high.max(v))))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axis_maps_values_to_positions() {
        let axis = Axis::between("x", 10.0, 20.0);
        assert_eq!(axis.at(10.0), Some(0.0));
        assert_eq!(axis.at(12.5), Some(0.25));
        assert_eq!(axis.at(30.0), Some(2.0));
        assert_eq!(axis.at(f64::NAN), None);
        assert_eq!(axis.reversed().at(12.5), Some(0.75));
        let axis = Axis::logarithmic("t", [1.4, 1000.0 / 1.4]);
        assert!((axis.at(10f64.powf(1.5)).unwrap() - 0.5).abs() < 1e-12);
        assert_eq!(axis.at(0.0), None);
        assert_eq!(axis.at(-1.0), None);
    }

    #[test]
    fn ranges_hold_the_values_whatever_they_are() {
        for values in [
            vec![],
            vec![f64::NAN],
            vec![3.0],
            vec![0.0, 0.0],
            vec![-1e308, 1e308],
            vec![1.0, f64::INFINITY, 2.0],
        ] {
            for axis in [
                Axis::around("a", values.clone()),
                Axis::from_zero("b", values.clone()),
                Axis::logarithmic("c", values.clone()),
            ] {
                let (low, high) = axis.range();
                assert!(low < high && (high - low).is_finite(), "{values:?}");
                assert!(axis.ticks(6).len() < 20);
                assert!(axis.at(1.5).is_none_or(f64::is_finite));
            }
        }
        assert_eq!(Axis::around("a", [0.0, 0.0]).range(), (0.0, 1.0));
        let (low, high) = Axis::around("a", [f64::NAN, 2.0, 4.0]).range();
        assert!(low < 2.0 && high > 4.0 && low > 1.8 && high < 4.2);
    }
}
