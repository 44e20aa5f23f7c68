//! Random numbers of a patient: Philox4x32-10 by seed, stream and index, so that the numbers of a breath
//! do not depend on the numbers of earlier breaths.

use phasmid_core::philox::philox;

/// Separates this module's counters from others under the same seed.
const PATIENT: u32 = 0x7061_7469;

/// A random stream.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Draws {
    key: [u32; 2],
    stream: u32,
}

impl Draws {
    pub(super) fn new(seed: u64, stream: u32) -> Self {
        Self {
            key: [seed as u32, (seed >> 32) as u32],
            stream,
        }
    }

    /// Returns a uniform number in (0, 1) with 53 random bits.
    pub(super) fn unit(self, index: i64) -> f64 {
        let counter = [index as u32, (index >> 32) as u32, self.stream, PATIENT];
        let [high, low, ..] = philox(counter, self.key);
        let bits = u64::from(high) << 21 | u64::from(low >> 11);
        (bits as f64 + 0.5) * (-53f64).exp2()
    }

    /// Returns a uniform number in (-1, 1).
    pub(super) fn even(self, index: i64) -> f64 {
        2.0 * self.unit(index) - 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_even_and_streams_apart() {
        let draws = Draws::new(3, 4);
        let count = 20_000;
        let (mut sum, mut squares) = (0.0, 0.0);
        for i in 0..count {
            let v = draws.even(i - count / 2);
            sum += v;
            squares += v * v;
        }
        let n = count as f64;
        // Allow five standard deviations for each of the two means.
        assert!((sum / n).abs() < 5.0 * (1.0 / (3.0 * n)).sqrt());
        assert!((squares / n - 1.0 / 3.0).abs() < 5.0 * (4.0 / (45.0 * n)).sqrt());
        assert_eq!(draws.unit(-7), Draws::new(3, 4).unit(-7));
        assert_ne!(draws.unit(7), Draws::new(3, 5).unit(7));
        assert_ne!(draws.unit(7), Draws::new(4, 4).unit(7));
        assert_ne!(draws.unit(7), draws.unit(-7));
    }
}
