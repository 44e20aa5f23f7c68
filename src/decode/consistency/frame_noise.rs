//! The noise of the frames of a capture.

use super::pixels::{Line, Pixels};
use crate::{Plan, deviation, estimate_noise};
use phasmid_core::statistics::median;
use phasmid_geometry::NoiseModel;
use phasmid_pattern::Image;
use rayon::prelude::*;

/// Maximum factor by which the calibration's noise is scaled up to match the frames; larger factors are
/// clamped.
const KNOWN: f64 = 2.0;
/// Minimum light of a bright frame, relative to the brightest frame.
const BRIGHTEST: f64 = 0.6;
/// Spacing in pixels of the samples from which noise is estimated by redundancy.
const THIN: usize = 3;
/// Number of rows from which the noise between neighbouring pixels is estimated.
const ROWS: usize = 16;
/// Approximate number of pixels used for the estimate of the noise between neighbouring pixels.
const SMOOTH: usize = 3_000;
/// Spacing of the lit pixels that are used to measure the light of a frame. It is a prime number, so
/// the columns differ from row to row.
const FEW: usize = 5;
/// Minimum light of a lit pixel in its brightest frame, relative to the 99th percentile of all pixels.
const LIT: f32 = 0.25;
/// Minimum light of a bright pixel of a frame, relative to the 90th percentile of the frame's lit
/// pixels.
const BRIGHT_PART: f32 = 0.5;

/// Returns the noise of the frames, of which some columns and some rows are given: the smaller of the
/// noise estimated from redundancy and the noise between neighbouring pixels in the smoothest frames.
/// Damage raises the first estimate, texture the second. If the noise is `known` from a calibration,
/// this noise is returned, scaled up towards the estimate if the estimate is larger, but by a factor of
/// at most [`KNOWN`].
pub(super) fn noise_of(
    plan: &Plan,
    columns: &[Image],
    rows: &Pixels,
    full: f64,
    known: Option<NoiseModel>,
) -> NoiseModel {
    let estimate = || {
        let thin: Vec<Image> = columns.iter().map(|f| f.thinned(THIN)).collect();
        estimate_noise(plan, &thin.iter().map(Image::view).collect::<Vec<_>>())
    };
    let ((light, smooth), estimated) = rayon::join(|| smoothness(rows, full), estimate);
    let found = match estimated {
        Some(noise) if noise.variance_dn2(light) <= smooth.variance_dn2(light) => noise,
        _ => smooth,
    };
    let Some(known) = known else {
        return found;
    };
    let more = found.variance_dn2(light) / known.variance_dn2(light).max(1e-9);
    let factor = more.clamp(1.0, KNOWN * KNOWN);
    NoiseModel {
        gain_dn_per_e: known.gain_dn_per_e * factor,
        read_noise_dn: known.read_noise_dn * factor.sqrt(),
        ..known
    }
}

/// Returns the light of bright frames in DN, and a noise model from fourth differences of lit pixels
/// along rows: a line through the smoothest frame and the smoothest bright frame. `full` is the largest
/// value of a sample.
fn smoothness(rows: &Pixels, full: f64) -> (f64, NoiseModel) {
    let lit = lit(rows);
    // Use only the frame's bright pixels: parts of each code and fringe frame are dark.
    let of_frame = |frame: &Vec<f32>| {
        let mut lights: Vec<f32> = lit.iter().step_by(FEW).map(|i| frame[*i]).collect();
        let tenth = lights.len() * 9 / 10;
        if lights.is_empty() {
            return None;
        }
        let high = *lights.select_nth_unstable_by(tenth, f32::total_cmp).1;
        let is_bright = |i: &&usize| frame[**i] >= BRIGHT_PART * high;
        let bright: Vec<usize> = lit.iter().filter(is_bright).copied().collect();
        lights.retain(|light| *light >= BRIGHT_PART * high);
        let light = median(&mut lights)?;
        let step = |i: &usize| {
            let [a, b, c, d, e]: [f32; 5] = std::array::from_fn(|k| frame[i + k - 2]);
            f64::from((a + e - 4.0 * (b + d) + 6.0 * c).abs())
        };
        let mut steps: Vec<f64> = bright.iter().map(step).collect();
        // A difference with the weights 1, -4, 6, -4, 1 has 70 times the variance of a sample.
        let deviation = deviation::of_most(&mut steps, 3.0, 2.0) / 70f64.sqrt();
        Some((f64::from(light), deviation * deviation))
    };
    let mut found: Vec<(f64, f64)> = rows.frames().par_iter().filter_map(of_frame).collect();
    found.sort_by(|a, b| a.1.total_cmp(&b.1));
    let brightest = found.iter().map(|(light, _)| *light).fold(0.0, f64::max);
    let (dark, low) = found.first().copied().unwrap_or((0.0, 1.0));
    let mut bright = found
        .iter()
        .filter(|(light, _)| *light >= BRIGHTEST * brightest);
    let (light, high) = bright.next().copied().unwrap_or((dark, low));
    let gain = ((high - low) / (light - dark).max(1.0)).max(0.0);
    let noise = NoiseModel {
        gain_dn_per_e: gain,
        read_noise_dn: (low - gain * dark).max(0.25 * low).sqrt(),
        black_level_dn: 0.0,
        saturation_dn: full,
    };
    (light, noise)
}

/// Lit pixels of some rows, without the two pixels at either end. Unlit pixels have less noise and are
/// the majority in many captures, so they would dominate the estimate.
fn lit(rows: &Pixels) -> Vec<usize> {
    let every = (rows.width * ROWS / SMOOTH).max(1);
    let lines = rows.lines(true, ROWS);
    let inner = |line: &Line| {
        let pixels = line.pixels().take(rows.width.saturating_sub(2));
        pixels.skip(2).step_by(every).collect::<Vec<_>>()
    };
    let pixels: Vec<usize> = lines.iter().flat_map(inner).collect();
    let mut most = vec![0.0f32; pixels.len()];
    for frame in rows.frames() {
        for (most, pixel) in most.iter_mut().zip(&pixels) {
            *most = most.max(frame[*pixel]);
        }
    }
    let (mut sorted, place) = (most.clone(), most.len() * 99 / 100);
    let bright = match sorted.is_empty() {
        true => 0.0,
        false => *sorted.select_nth_unstable_by(place, f32::total_cmp).1,
    };
    let pixels = pixels.into_iter().zip(most);
    let lit = pixels.filter(|(_, most)| LIT * bright <= *most);
    lit.map(|(pixel, _)| pixel).collect()
}
