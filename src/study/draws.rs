//! Random numbers of studies: Philox4x32-10 by seed, stream and index.

use glam::DVec2;
use phasmid_core::philox::philox;
use std::f64::consts::TAU;

/// Random numbers that depend only on seed, stream and index.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Draws {
    key: [u32; 2],
    stream: u32,
}

impl Draws {
    pub(crate) fn new(seed: u64, stream: u32) -> Self {
        Self {
            key: [seed as u32, (seed >> 32) as u32],
            stream,
        }
    }

    /// Two uniform numbers in (0, 1).
    fn pair(&self, index: u64) -> [f64; 2] {
        let counter = [index as u32, (index >> 32) as u32, self.stream, 0x7374_6162];
        let [a, b, c, d] = philox(counter, self.key);
        let unit = |high: u32, low: u32| {
            let bits = u64::from(high) << 21 | u64::from(low >> 11);
            (bits as f64 + 0.5) / (1u64 << 53) as f64
        };
        [unit(a, b), unit(c, d)]
    }

    /// Two normal numbers (Box and Muller, Ann. Math. Stat. 29, 1958).
    pub(crate) fn normals(&self, index: u64) -> DVec2 {
        let [u, v] = self.pair(index);
        DVec2::from_angle(TAU * v) * (-2.0 * u.ln()).sqrt()
    }
}
