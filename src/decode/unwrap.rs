//! Spatial phase unwrapping for a single period: a flood fill that always extends the most precise
//! pixel first. A simplification of Herraez et al., "Fast two-dimensional phase-unwrapping algorithm
//! based on sorting by reliability following a noncontinuous path", Appl. Opt. 41(35), 2002. Each
//! connected region is correct up to one integer number of periods.

use std::collections::BinaryHeap;

/// Unwraps coordinates known modulo `period` in place. NaN pixels separate regions; pixels with
/// smaller `sigma` go first.
pub(super) fn unwrap(width: usize, x: &mut [f32], sigma: &[f32], period: f32) {
    let height = x.len() / width;
    let mut done = vec![false; x.len()];
    // Positive floats sort like their bits.
    let quality = |i: usize| u32::MAX - sigma[i].max(0.0).to_bits();
    let mut seeds: Vec<u32> = (0..x.len() as u32)
        .filter(|&i| !x[i as usize].is_nan())
        .collect();
    seeds.sort_by_key(|&i| (u32::MAX - quality(i as usize), i));
    let mut heap = BinaryHeap::new();
    for seed in seeds {
        if done[seed as usize] {
            continue;
        }
        done[seed as usize] = true;
        heap.push((quality(seed as usize), seed));
        while let Some((_, at)) = heap.pop() {
            let i = at as usize;
            let (u, v) = (i % width, i / width);
            let neighbours = [
                (u > 0).then(|| i - 1),
                (u + 1 < width).then_some(i + 1),
                (v > 0).then(|| i - width),
                (v + 1 < height).then_some(i + width),
            ];
            for j in neighbours.into_iter().flatten() {
                if !done[j] && !x[j].is_nan() {
                    done[j] = true;
                    x[j] += period * ((x[i] - x[j]) / period).round();
                    heap.push((quality(j), j as u32));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smooth_surface_is_unwrapped_up_to_whole_periods() {
        let (width, height) = (60, 40);
        let truth: Vec<f32> = (0..width * height)
            .map(|i| ((i % width) as f32) * 3.1 + ((i / width) as f32 * 0.2).sin() * 20.0)
            .collect();
        let mut x: Vec<f32> = truth.iter().map(|v| v.rem_euclid(16.0)).collect();
        for v in 0..height {
            x[v * width + 30] = f32::NAN; // two regions
        }
        unwrap(width, &mut x, &vec![0.1; width * height], 16.0);
        for side in [0..30, 31..60] {
            let shift = x[side.start] - truth[side.start];
            assert!((shift / 16.0 - (shift / 16.0).round()).abs() < 1e-3);
            for v in 0..height {
                for u in side.clone() {
                    let i = v * width + u;
                    assert!((x[i] - truth[i] - shift).abs() < 1e-3);
                }
            }
        }
    }
}
