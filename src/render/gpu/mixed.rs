//! Mixed pixels in GPU memory (`mixed_types.wgsl` and related buffers). The samples of a pixel are
//! stored in groups of sixteen; a record called a head describes each group.

use super::Engine;
#[cfg(test)]
use super::engine::words;
#[cfg(test)]
use crate::exposure::Mixed;
use bytemuck::{Pod, Zeroable};
use phasmid_core::error::{Error, Result};

/// Number of samples per head.
const LANES: u64 = 16;
/// Number of words in `mixed_count`; the last word is the highest number of heads that a pass has
/// needed.
const COUNTS: u64 = 5;
/// Minimum capacity in number of heads.
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

/// Capacity for the heads of mixed pixels. It starts at a size that suffices for most scenes. If a
/// pass needs more, the capacity grows and the pass is run again, so no sample is lost.
#[derive(Debug, Clone, Copy)]
pub(super) struct Room {
    pub(super) heads: u64,
    /// Maximum capacity in number of heads, limited by the adapter's largest buffer.
    most: u64,
    /// Whether the spread of light under skin is stored for each sample.
    skin: bool,
}

/// Bytes per sample for the spread of light under skin.
const SKIN: u64 = 24;

impl Room {
    /// Creates a capacity of `heads` heads, limited to what the adapter can hold, and allocates it.
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

    /// Grows the capacity to the number of heads that a pass has needed. Returns whether it had to
    /// grow.
    ///
    /// # Errors
    /// Returns an error if the adapter cannot hold this number of heads.
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

/// Resets the recorded number of heads that passes have needed.
pub(super) fn forget(engine: &mut Engine) {
    engine.write("mixed_count", &[0; COUNTS as usize * 4]);
}

/// Returns the highest number of heads that a pass has needed; waits for the GPU.
#[cfg(test)]
pub(super) fn wanted(engine: &Engine) -> Result<u64> {
    let counts: Vec<u32> = words(engine, "mixed_count", COUNTS)?;
    Ok(counts[COUNTS as usize - 1].into())
}

/// Reads the mixed pixels back, in the layout and order of the CPU and without skin data.
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
    // The sort is stable, so the groups of one pixel keep their order.
    found.sort_by_key(|mixed| mixed.pixel);
    Ok(found)
}
