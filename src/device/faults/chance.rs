//! Counter-based random numbers: a fault's draws depend only on the schedule's seed, the device's
//! name, the number of the fault and the number of the event.

use phasmid_core::philox::philox;

/// Random source of a schedule on one device.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Chance {
    key: [u32; 2],
}

/// The random draws of one event of one fault.
#[derive(Debug, Clone)]
pub(super) struct Draws {
    key: [u32; 2],
    fault: u64,
    event: u64,
    drawn: u32,
}

impl Chance {
    /// Returns the source of a device; devices with the same schedule get independent draws.
    pub(super) fn new(seed: u64, device: &str) -> Self {
        // FNV-1a: Fowler, Noll, Vo, "The FNV Non-Cryptographic Hash Algorithm".
        let name = device.bytes().fold(0x811C_9DC5_u32, |hash, byte| {
            (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)
        });
        Self {
            key: [seed as u32 ^ name, (seed >> 32) as u32],
        }
    }

    /// Returns the draws of an event of a fault; repeated calls give the same draws.
    pub(super) fn draws(self, fault: u64, event: u64) -> Draws {
        Draws {
            key: self.key,
            fault,
            event,
            drawn: 0,
        }
    }
}

impl Draws {
    /// Returns 64 random bits.
    fn bits(&mut self) -> u64 {
        let counter = [
            self.drawn,
            self.fault as u32,
            self.event as u32,
            (self.event >> 32) as u32,
        ];
        self.drawn = self.drawn.wrapping_add(1);
        let [low, high, ..] = philox(counter, self.key);
        u64::from(high) << 32 | u64::from(low)
    }

    /// Returns a uniform number in [0, 1) with 53 bits.
    pub(super) fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (-53f64).exp2()
    }

    /// Returns a uniform number below `end`, or 0 if `end` is 0. Multiply-and-shift is uniform to
    /// within 2^-64 `end`.
    pub(super) fn below(&mut self, end: usize) -> usize {
        ((u128::from(self.bits()) * end as u128) >> 64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_depend_only_on_seed_device_fault_and_event() {
        let chance = Chance::new(7, "left");
        let take = |chance: Chance, fault, event| {
            let mut draws = chance.draws(fault, event);
            [draws.unit(), draws.unit(), draws.below(1000) as f64]
        };
        let one = take(chance, 1, 1);
        assert_eq!(one, take(chance, 1, 1));
        for other in [
            take(chance, 2, 1),
            take(chance, 1, 2),
            take(chance, 1, 1 << 32 | 1),
            take(Chance::new(8, "left"), 1, 1),
            take(Chance::new(7, "right"), 1, 1),
        ] {
            assert!(one.iter().zip(other).all(|(a, b)| *a != b), "{other:?}");
        }
        let mut draws = chance.draws(3, 3);
        let mean = (0..10_000).map(|_| draws.unit()).sum::<f64>() / 1e4;
        // Five standard deviations of the mean of 10,000 uniform numbers.
        assert!((mean - 0.5).abs() < 5.0 * (1.0f64 / 12e4).sqrt(), "{mean}");
        assert!((0..10_000).all(|_| draws.below(3) < 3));
        assert_eq!(draws.below(0), 0);
    }
}
