//! Keyframes in time: selects and weights the keyframes that determine the value at a given time.
//!
//! Between keyframes, values follow cubic Hermite splines whose tangents are the chords between the
//! neighbours of a keyframe (Catmull and Rom: "A class of local interpolating splines", 1974,
//! generalised to uneven times). The curve passes through every keyframe, its first derivative is
//! continuous, a straight motion stays straight, and it overshoots by at most 4/27 of the chords.

/// Ascending keyframe times, and the period after which they repeat.
#[derive(Debug, Clone, PartialEq)]
pub struct Timeline {
    times_s: Vec<f64>,
    period_s: Option<f64>,
}

/// The interval of a timeline between two keyframes, with the neighbouring keyframes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// Keyframe before the start, the start, the end, and the keyframe after the end. At the ends
    /// of the timeline the start or the end is repeated.
    pub keys: [usize; 4],
    /// Times of `keys` in seconds, continued across the wrap-around of a period.
    pub times_s: [f64; 4],
    /// Relative position between start and end, 0 to 1.
    pub share: f64,
}

impl Timeline {
    /// Creates a timeline of at least one keyframe, with strictly ascending times. The period must
    /// exceed the time from the first to the last keyframe. Without a period, the first and last
    /// values are held.
    pub fn new(times_s: Vec<f64>, period_s: Option<f64>) -> Self {
        debug_assert!(times_s.windows(2).all(|pair| pair[0] < pair[1]));
        Self { times_s, period_s }
    }

    /// Returns the span that contains a time.
    pub fn span(&self, time_s: f64) -> Span {
        let (first, count) = (self.times_s[0], self.times_s.len());
        let last = self.times_s[count - 1];
        let time_s = match self.period_s {
            Some(period) => first + (time_s - first).rem_euclid(period),
            None => time_s.clamp(first, last),
        };
        let past = self.times_s.partition_point(|&t| t <= time_s);
        let start = past.clamp(1, self.spans()) - 1;
        let keys = [-1, 0, 1, 2].map(|step| self.key(start as isize + step));
        let [_, from, to, _] = keys.map(|(_, time)| time);
        let share = if to > from {
            ((time_s - from) / (to - from)).clamp(0.0, 1.0)
        } else {
            0.0
        };
        Span {
            keys: keys.map(|(key, _)| key),
            times_s: keys.map(|(_, time)| time),
            share,
        }
    }

    /// Number of spans: at least one, of zero length if there is only one keyframe.
    fn spans(&self) -> usize {
        match self.period_s {
            Some(_) => self.times_s.len(),
            None => (self.times_s.len() - 1).max(1),
        }
    }

    /// Returns a keyframe and its time; indices beyond the ends continue periodically or are
    /// clamped.
    fn key(&self, index: isize) -> (usize, f64) {
        let count = self.times_s.len() as isize;
        let (turns, key) = match self.period_s {
            Some(_) => (index.div_euclid(count), index.rem_euclid(count) as usize),
            None => (0, index.clamp(0, count - 1) as usize),
        };
        let seam = self.period_s.map_or(0.0, |period| period * turns as f64);
        (key, self.times_s[key] + seam)
    }
}

impl Span {
    /// Returns the weights of the four keyframes, which add up to 1.
    pub fn weights(&self) -> [f64; 4] {
        let s = self.share;
        let [before, from, to, after] = self.times_s;
        let end = s * s * (3.0 - 2.0 * s);
        // Hermite basis of both tangents, each divided by the length of its chord.
        let chord = |basis: f64, length: f64| {
            if length > 0.0 {
                basis * (to - from) / length
            } else {
                0.0
            }
        };
        let leaving = chord(s * (1.0 - s) * (1.0 - s), to - before);
        let arriving = chord(-s * s * (1.0 - s), after - from);
        [-leaving, 1.0 - end - arriving, end + leaving, arriving]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn value(timeline: &Timeline, values: &[f64], t: f64) -> f64 {
        let span = timeline.span(t);
        let weights = span.weights();
        (0..4).map(|i| weights[i] * values[span.keys[i]]).sum()
    }

    #[test]
    fn passes_through_keys_holds_beyond_them_and_is_smooth() {
        let times = [0.5, 1.0, 3.0, 3.25];
        let values = [2.0, -1.0, 4.0, 4.5];
        let line = Timeline::new(times.to_vec(), None);
        for (t, v) in times.into_iter().zip(values) {
            assert_eq!(value(&line, &values, t), v, "exactly");
        }
        assert_eq!(value(&line, &values, -7.0), 2.0);
        assert_eq!(value(&line, &values, 1e9), 4.5);
        let speed = |t: f64| (value(&line, &values, t + 1e-7) - value(&line, &values, t)) / 1e-7;
        for t in [1.0, 3.0] {
            assert!((speed(t) - speed(t - 1e-7)).abs() < 1e-4, "a kink at {t}");
        }
        let single = Timeline::new(vec![4.0], None);
        assert_eq!(value(&single, &[3.0], 9.0), 3.0);
    }

    #[test]
    fn a_line_stays_a_line() {
        let times = vec![0.0, 0.1, 2.0, 2.2, 9.0];
        let values: Vec<f64> = times.iter().map(|t| 3.0 - 7.0 * t).collect();
        let line = Timeline::new(times, None);
        for i in 0..=900 {
            let t = f64::from(i) / 100.0;
            let error = value(&line, &values, t) - (3.0 - 7.0 * t);
            assert!(error.abs() < 1e-13, "{t}: {error}");
        }
    }

    #[test]
    fn periodic_timeline_repeats_smoothly() {
        let times = [1.0, 1.7, 2.9];
        let values = [0.0, 5.0, -2.0];
        let line = Timeline::new(times.to_vec(), Some(2.5));
        let at = |t: f64| value(&line, &values, t);
        for i in 0..100 {
            let t = f64::from(i) * 0.05;
            assert!((at(t) - at(t + 250.0)).abs() < 1e-10, "{t}");
            assert!((at(t) - at(t - 2.5)).abs() < 1e-10, "{t}");
        }
        for t in [1.0, 3.5] {
            assert!(at(t).abs() < 1e-12);
            let (left, right) = ((at(t) - at(t - 1e-6)) / 1e-6, (at(t + 1e-6) - at(t)) / 1e-6);
            assert!((left - right).abs() < 1e-4, "{left} {right}");
        }
    }

    #[test]
    fn interpolation_of_a_sine_converges_with_more_keys() {
        let worst = |keys: usize| {
            let times: Vec<f64> = (0..keys).map(|k| k as f64 / keys as f64).collect();
            let values: Vec<f64> = times.iter().map(|t| (TAU * t).sin()).collect();
            let line = Timeline::new(times, Some(1.0));
            (0..1000)
                .map(|i| f64::from(i) / 1000.0)
                .map(|t| (value(&line, &values, t) - (TAU * t).sin()).abs())
                .fold(0.0, f64::max)
        };
        let (coarse, fine) = (worst(16), worst(32));
        // Tangents by central differences: at least third order.
        assert!(coarse < 5e-3 && fine < coarse / 7.0, "{coarse} {fine}");
    }

    #[test]
    fn uneven_keys_do_not_overshoot() {
        // Rises within 0.1 s, then stays constant.
        let line = Timeline::new(vec![0.0, 0.1, 10.0, 20.0], None);
        for i in 0..2000 {
            let v = value(&line, &[0.0, 10.0, 10.0, 10.0], f64::from(i) / 100.0);
            assert!((-1.5..=11.5).contains(&v), "{v}");
        }
    }
}
