//! Random numbers for many pixels: a SIMD version of [`phasmid_core::philox`]. A frame's noise is
//! independent of the number of threads and the order of evaluation.

use phasmid_core::philox::{M, ROUNDS, W};
use phasmid_core::simd::widest;

/// Number of counters that [`block`] processes in parallel.
pub(super) const WIDTH: usize = 8;
/// Number of random words in a block, one per pixel.
pub(super) const BLOCK: usize = 4 * WIDTH;

/// Returns the random words of `BLOCK` pixels, one word per pixel: word w of counter c belongs to
/// pixel `block_index * BLOCK + w * WIDTH + c` of the frame.
///
/// `key` is the seed; the counter is (pixel counter, draw, low and high half of the shot's noise
/// id).
///
/// Words are stored in 64-bit lanes, whose upper halves hold leftovers of products. A SIMD
/// multiplication reads only the lower halves and returns full products, so lanes need no shuffling.
#[inline(always)]
fn block(key: u64, block_index: u32, draw: u32, frame: u64) -> [u32; BLOCK] {
    const LOW: u64 = u32::MAX as u64;
    let first = block_index.wrapping_mul(WIDTH as u32);
    let mut c0: [u64; WIDTH] = std::array::from_fn(|i| u64::from(first.wrapping_add(i as u32)));
    let mut c1 = [u64::from(draw); WIDTH];
    let mut c2 = [frame & LOW; WIDTH];
    let mut c3 = [frame >> 32; WIDTH];
    let mut k = [key as u32, (key >> 32) as u32];
    for _ in 0..ROUNDS {
        for i in 0..WIDTH {
            let p0 = u64::from(M[0]) * (c0[i] & LOW);
            let p1 = u64::from(M[1]) * (c2[i] & LOW);
            let n0 = (p1 >> 32) ^ c1[i] ^ u64::from(k[0]);
            let n2 = (p0 >> 32) ^ c3[i] ^ u64::from(k[1]);
            (c0[i], c1[i], c2[i], c3[i]) = (n0, p1, n2, p0);
        }
        k = [k[0].wrapping_add(W[0]), k[1].wrapping_add(W[1])];
    }
    let mut words = [0; BLOCK];
    for (chunk, c) in words.chunks_exact_mut(WIDTH).zip([c0, c1, c2, c3]) {
        for i in 0..WIDTH {
            chunk[i] = c[i] as u32;
        }
    }
    words
}

widest! {
    /// Fills `words` with consecutive blocks that start at `first_block`; see [`block`]. This is a
    /// separate pass so that its lanes stay in registers.
    pub(super) fn fill(key: [u64; 2], first_block: u32, draw: u32, words: &mut [[u32; BLOCK]])
        => fill_body
}

#[inline(always)]
fn fill_body([seed, frame]: [u64; 2], first_block: u32, draw: u32, words: &mut [[u32; BLOCK]]) {
    for (i, words) in words.iter_mut().enumerate() {
        *words = block(seed, first_block.wrapping_add(i as u32), draw, frame);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_core::philox::philox;

    /// GPU and CPU agree for the published test vectors and for random ones, both for the words of a
    /// counter and for the words of its pixels.
    #[cfg(feature = "gpu")]
    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn gpu_words_equal_those_of_the_cpu() {
        let mut input = vec![0; 6];
        input.extend([u32::MAX; 6]);
        input.extend([0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344]);
        input.extend([0xa409_3822, 0x299f_31d0]);
        let random: Vec<_> = (0..1000).map(|i| block(1, i, 9, 2)).collect();
        input.extend(random.as_flattened());
        let count = input.len() / 6;
        let output =
            crate::gpu::Engine::for_tests().call("tests/philox_test", &input, count * 8, count);
        let expected = |words: &[u32; 6]| {
            let [a, b, c, d, k, l] = *words;
            [a, a >> 5].map(|a| philox([a, b, c, d], [k, l]))
        };
        let (counters, _) = input.as_chunks();
        let expected: Vec<_> = counters.iter().flat_map(expected).collect();
        assert!(expected.as_flattened() == output);
    }

    #[test]
    fn block_holds_words_of_eight_counters() {
        let (key, frame) = (0x0123_4567_89ab_cdef, 0xfedc_ba98_7654_3210u64);
        let words = block(key, 7, 3, frame);
        for lane in 0..WIDTH {
            let counter = [7 * 8 + lane as u32, 3, frame as u32, (frame >> 32) as u32];
            let expected = philox(counter, [key as u32, (key >> 32) as u32]);
            let got: [u32; 4] = std::array::from_fn(|w| words[w * WIDTH + lane]);
            assert_eq!(got, expected);
        }
    }
}
