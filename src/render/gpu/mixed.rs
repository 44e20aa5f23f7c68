//! Mixed pixels in the GPU's memory: `mixed_types.wgsl` and what goes with it.

use super::Engine;
#[cfg(test)]
use super::maps::words;
#[cfg(test)]
use crate::buffer::Mixed;
use bytemuck::{Pod, Zeroable};
use phasmid_core::error::{Error, Result};

/// Samples of a head.
const LANES: u64 = 16;
/// Words of `mixed_count`; the last one is the most heads that a pass has wanted.
const COUNTS: u64 = 5;
/// Room for so many heads at least.
const LEAST: u64 = 1024;

/// Twin of `MixedSample` in `mixed_types.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub(super) struct MixedSample {
    pub(super) place: [f32; 2],
    pub(super) slopes: [[f32; 2]; 2],
    pub(super) projected: f32,
    pub(super) blur: f32,
}

/// How many heads of mixed pixels there is room for. It starts at what most scenes fit in and grows
/// when a pass has wanted more, which is then run again: no sample is lost.
#[derive(Debug, Clone, Copy)]
pub(super) struct Room {
    pub(super) heads: u64,
    /// What the adapter's largest buffer holds.
    most: u64,
    /// How skin spreads light is kept too.
    skin: bool,
}

/// Bytes of the spread of light under skin at one sample.
const SKIN: u64 = 24;

impl Room {
    /// For so many heads, or as many as the adapter can hold if that is less.
    pub(super) fn new(engine: &Engine, heads: u64, skin: bool) -> Self {
        let bytes = engine.gpu().largest_buffer();
        let most = bytes / (LANES * size_of::<MixedSample>() as u64);
        Self {
            heads: heads.max(LEAST).min(most),
            most,
            skin,
        }
    }

    pub(super) fn reserve(&self, engine: &mut Engine) {
        engine.reserve("mixed_heads", self.heads * 16);
        engine.reserve(
            "mixed_samples",
            self.heads * LANES * size_of::<MixedSample>() as u64,
        );
        engine.reserve("mixed_count", COUNTS * 4);
        if self.skin {
            engine.reserve("mixed_skin", self.heads * LANES * SKIN);
        }
    }

    /// Makes room for what a pass has wanted; tells whether there was too little.
    ///
    /// # Errors
    /// More than the adapter can hold.
    pub(super) fn grow(&mut self, wanted: u64) -> Result<bool> {
        if wanted <= self.heads {
            return Ok(false);
        }
        if wanted > self.most {
            return Err(Error::device(format!(
                "GPU: {wanted} groups of samples of pixels that see more than one surface, or blur; \
                 its buffers hold {}",
                self.most
            )));
        }
        self.heads = (wanted + wanted / 4).min(self.most);
        Ok(true)
    }
}

/// Takes back what passes have wanted until now.
pub(super) fn forget(engine: &mut Engine) {
    engine.write("mixed_count", &[0; COUNTS as usize * 4]);
}

/// The most heads that a pass has wanted; waits for it.
#[cfg(test)]
pub(super) fn wanted(engine: &Engine) -> Result<u64> {
    let counts: Vec<u32> = words(engine, "mixed_count", COUNTS)?;
    Ok(counts[COUNTS as usize - 1].into())
}

/// The mixed pixels as the CPU has them, in its order; skin aside.
#[cfg(test)]
pub(crate) fn back(engine: &Engine) -> Result<Vec<Mixed>> {
    let counts: Vec<u32> = words(engine, "mixed_count", COUNTS)?;
    let count = u64::from(counts[0]);
    let heads: Vec<[u32; 4]> = words(engine, "mixed_heads", count)?;
    let samples: Vec<MixedSample> = words(engine, "mixed_samples", count * LANES)?;
    let mut found: Vec<_> = heads
        .iter()
        .zip(samples.chunks(LANES as usize))
        .map(|(&[pixel, _, ambient, flickering], samples)| {
            let mut mixed = Mixed::new(pixel);
            mixed.ambient = f32::from_bits(ambient);
            mixed.flickering = f32::from_bits(flickering);
            for (k, sample) in samples.iter().enumerate() {
                [mixed.x[k], mixed.y[k]] = sample.place;
                [mixed.x_slope[k], mixed.y_slope[k]] = sample.slopes;
                (mixed.projected[k], mixed.blur[k]) = (sample.projected, sample.blur);
            }
            mixed
        })
        .collect();
    // Stable: groups of one pixel stay in their order.
    found.sort_by_key(|mixed| mixed.pixel);
    Ok(found)
}
