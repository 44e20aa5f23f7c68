//! Mixed pixels in GPU memory: `mixed_types.wgsl` and related buffers. The samples of a pixel are
//! stored in groups of sixteen; a record called head describes each group.

use super::Engine;
#[cfg(test)]
use super::engine::words;
#[cfg(test)]
use crate::exposure::Mixed;
use bytemuck::{Pod, Zeroable};
use phasmid_core::error::{Error, Result};

/// Samples per head.
const LANES: u64 = 16;
/// Words of `mixed_count`; the last is the highest number of heads that a pass has needed.
const COUNTS: u64 = 5;
/// Minimum capacity in heads.
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

/// Capacity for heads of mixed pixels. It starts at a size sufficient for most scenes. If a pass
/// needs more, it grows and the pass is run again, so no sample is lost.
#[derive(Debug, Clone, Copy)]
pub(super) struct Room {
    pub(super) heads: u64,
    /// Maximum capacity, limited by the adapter's largest buffer.
    most: u64,
    /// Whether subsurface spread is stored too.
    skin: bool,
}

/// Bytes per sample of subsurface spread.
const SKIN: u64 = 24;

impl Room {
    /// Allocates space for `heads` heads, limited to what the adapter can hold.
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

    /// Grows to the number of heads a pass needed; returns whether it had to grow.
    ///
    /// # Errors
    /// Returns an error if that exceeds what the adapter can hold.
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

/// Resets the recorded number of heads needed.
pub(super) fn forget(engine: &mut Engine) {
    engine.write("mixed_count", &[0; COUNTS as usize * 4]);
}

/// Returns the highest number of heads that a pass has needed; waits for the GPU.
#[cfg(test)]
pub(super) fn wanted(engine: &Engine) -> Result<u64> {
    let counts: Vec<u32> = words(engine, "mixed_count", COUNTS)?;
    Ok(counts[COUNTS as usize - 1].into())
}

/// Reads the mixed pixels back in the CPU's layout and order, without skin.
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
    // The sort is stable, so groups of one pixel keep their order.
    found.sort_by_key(|mixed| mixed.pixel);
    Ok(found)
}
