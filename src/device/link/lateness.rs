//! How late a device in real time handles events: count, mean, maximum, and a histogram for
//! percentiles. Memory use does not depend on the number of events.
//!
//! There are eight bins per factor of two (below 16 ns, one bin for each value). A percentile is
//! reported as the upper end of its bin: at most an eighth too large and never too small.

/// Number of bins per factor of two.
const PER_OCTAVE: u64 = 8;
/// Number of bins: two octaves with one bin for each value, then eight bins for each factor of two
/// up to `u64::MAX`.
const BINS: usize = (PER_OCTAVE * (64 - 2)) as usize;

/// Statistics of how late events were handled.
#[derive(Debug, Clone)]
pub struct Lateness {
    bins: Box<[u64; BINS]>,
    count: u64,
    sum_ns: u128,
    max_ns: u64,
}

impl Default for Lateness {
    fn default() -> Self {
        Self {
            bins: Box::new([0; BINS]),
            count: 0,
            sum_ns: 0,
            max_ns: 0,
        }
    }
}

impl Lateness {
    /// Counts an event handled `late_ns` after it was due.
    pub fn count(&mut self, late_ns: u64) {
        self.bins[bin(late_ns)] += 1;
        self.count += 1;
        self.sum_ns += u128::from(late_ns);
        self.max_ns = self.max_ns.max(late_ns);
    }

    /// Returns the number of events.
    pub fn events(&self) -> u64 {
        self.count
    }

    /// Returns the mean in nanoseconds; 0 without events.
    pub fn mean_ns(&self) -> u64 {
        (self.sum_ns / u128::from(self.count.max(1))) as u64
    }

    /// Returns the maximum in nanoseconds; 0 without events.
    pub fn max_ns(&self) -> u64 {
        self.max_ns
    }

    /// Returns an upper bound, in nanoseconds, of the lateness of the `percent` percent of the
    /// events that were least late; 0 without events.
    pub fn percentile_ns(&self, percent: u64) -> u64 {
        let rank = u128::from(self.count) * u128::from(percent.min(100));
        let mut below = 0;
        for (bin, &count) in self.bins.iter().enumerate() {
            below += u128::from(count);
            if count > 0 && below * 100 >= rank {
                return top_ns(bin).min(self.max_ns);
            }
        }
        self.max_ns
    }
}

/// Returns the bin of a value.
fn bin(ns: u64) -> usize {
    // Octaves that start at 8, 16, 32 ... have the numbers 0, 1, 2 ...; values below 8 belong to
    // octave 0.
    let octave = u64::from((ns | PER_OCTAVE).ilog2() - PER_OCTAVE.ilog2());
    (octave * PER_OCTAVE + (ns >> octave)) as usize
}

/// Returns the largest value of a bin.
fn top_ns(bin: usize) -> u64 {
    let bin = bin as u64;
    let octave = (bin / PER_OCTAVE).saturating_sub(1);
    let first = bin - octave * PER_OCTAVE;
    // Evaluated in this order nothing overflows: the last bin ends at `u64::MAX`.
    (first << octave) + ((1 << octave) - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_has_a_bin_that_ends_within_an_eighth() {
        let numbers = (0..64).flat_map(|bit| {
            let power = 1u64 << bit;
            [power - 1, power, power + 1, power + power / 3]
        });
        for ns in numbers.chain([u64::MAX]) {
            let top = top_ns(bin(ns));
            assert!(top >= ns && top - ns <= ns / 8, "{ns}: {top}");
            assert_eq!(bin(top), bin(ns), "{ns}");
            assert!(top == u64::MAX || bin(top + 1) == bin(ns) + 1, "{ns}");
        }
        assert_eq!(bin(u64::MAX), BINS - 1);
    }

    #[test]
    fn percentiles_are_those_of_the_sorted_list() {
        let mut late = Lateness::default();
        assert_eq!((late.percentile_ns(99), late.mean_ns()), (0, 0));
        for ns in 1..=1000 {
            late.count(ns * 1000);
        }
        assert_eq!((late.events(), late.mean_ns()), (1000, 500_500));
        for percent in [1, 50, 90, 99, 100] {
            let (told, want) = (late.percentile_ns(percent), percent * 10_000);
            assert!(
                (want..=want + want / 8).contains(&told),
                "{percent}: {told}"
            );
        }
        assert_eq!(late.percentile_ns(100), 1_000_000);
        late.count(u64::MAX);
        assert_eq!(
            (late.max_ns(), late.percentile_ns(100)),
            (u64::MAX, u64::MAX)
        );
    }
}
