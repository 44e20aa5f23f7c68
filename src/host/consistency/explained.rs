//! What a list of patterns explains of pixels' values.
//!
//! A pixel sees one point of the projector, so all frames that vary along an axis are one offset
//! and one contrast times what the patterns have at one coordinate. The best coordinate is sought, and
//! what it leaves is the misfit.

use super::contrasts::contrasts;
use super::grid::{Grid, range};
use phasmid_core::simd::widest;
use phasmid_decode::AxisPlan;
use phasmid_pattern::{Manifest, Pattern};
use std::f64::consts::TAU;

/// Coordinates that are tried in a period of the finest fringes.
const PER_PERIOD: f64 = 10.0;
/// They are no further apart, in projector pixels.
const STEP_PX: f64 = 2.0;
/// Patterns of a finer period are left out: a camera may blur them.
const FINE_PX: f64 = 10.0;
/// Coordinates that are tried, at most.
const COORDINATES: f64 = 8192.0;
/// A pixel's misfit counts up to this part of its squared range.
const CAP: f64 = 0.05;
/// Part of the finest stripe's length within which a pixel is at an edge.
const EDGE: f64 = 0.2;
/// Misfit below which nothing is doubted,
pub(super) const GOOD: f64 = 2e-3;
/// and where the contrast of each pattern is known: exchanged steps of one of three sets leave 2e-3.
const CLOSE: f64 = 1e-3;
/// And so many times what noise alone leaves: no list can leave less than the noise.
const NOISY: f64 = 2.0;

/// What a list explains: the mean misfit and the coordinate of each pixel.
pub(super) struct Fit {
    pub(super) misfit: f64,
    /// Each pixel's.
    pub(super) each: Vec<f64>,
    /// The part of it that is noise.
    noise: f64,
    /// Misfit below which it is not doubted.
    good: f64,
    /// Whether the list is a shifted one. Exchanged bits are told by `gray`.
    pub(super) shifted: bool,
    pub(super) coordinates: Vec<f64>,
}

impl Fit {
    /// Whether more is left than noise and what disturbs all frames alike leave.
    pub(super) fn is_doubtful(&self) -> bool {
        self.misfit > self.good.max(NOISY * self.noise)
    }
}

/// What each pattern has at each coordinate that is tried.
pub(super) struct Levels {
    /// By pattern; `None` for pictures, patterns of the other axis and such as a camera may blur.
    rows: Vec<Option<Vec<f32>>>,
    /// Length of the stripes of each Gray pattern, in projector pixels.
    runs: Vec<Option<f64>>,
    step_px: f64,
    /// Least length in projector pixels that the patterns tell apart.
    pub(super) finest: f64,
    noise_dn: f64,
    /// Whether the patterns are fringes alone, whose contrast is known.
    smooth: bool,
}

impl Levels {
    pub(super) fn new(manifest: &Manifest, axis: &AxisPlan, grid: &Grid) -> Self {
        let patterns = || manifest.frame.iter().map(|frame| &frame.pattern);
        let own = |pattern: &&Pattern| pattern.axis() == Some(axis.axis);
        let finest = patterns()
            .filter(own)
            .filter_map(resolved_px)
            .fold(axis.extent_px, f64::min);
        let step_px = (finest / PER_PERIOD)
            .min(STEP_PX)
            .max(axis.extent_px / COORDINATES);
        let count = (axis.extent_px / step_px).ceil() as usize;
        let contrasts = contrasts(manifest, axis, grid);
        let smooth = contrasts.is_some();
        let contrasts = contrasts.unwrap_or_else(|| vec![1.0; manifest.frame.len()]);
        let row = |(pattern, contrast): (&Pattern, f32)| {
            let shown = match pattern.axis() {
                None => true,
                Some(a) => a == axis.axis && resolved_px(pattern).is_some(),
            };
            let at = |i: usize| level(pattern, contrast, i as f64 * step_px);
            shown.then(|| (0..count).map(at).collect()).flatten()
        };
        Self {
            rows: patterns().zip(contrasts).map(row).collect(),
            runs: patterns()
                .map(|pattern| match pattern {
                    Pattern::Gray { .. } => resolved_px(pattern),
                    _ => None,
                })
                .collect(),
            step_px,
            finest,
            noise_dn: f64::from(grid.noise_dn),
            smooth,
        }
    }

    /// Returns the pixels that are not near an edge of the frame's stripes, located by the other
    /// frames; all pixels if the frame shows fringes or the other frames cannot locate them.
    pub(super) fn away_from_edges<'a>(
        &self,
        shows: &[Option<usize>],
        frame: usize,
        pixels: &[&'a [f32]],
    ) -> Vec<&'a [f32]> {
        let (Some(run_px), Some(row)) = (self.runs[frame], self.rows[frame].as_deref()) else {
            return pixels.to_vec();
        };
        let mut others = shows.to_vec();
        others[frame] = None;
        let Some(fit) = self.fit(&others, pixels, f64::INFINITY, true) else {
            return pixels.to_vec();
        };
        // Blur of an edge does not grow with the stripe.
        let reach = (EDGE * run_px.min(self.finest) / self.step_px).ceil() as usize;
        let is_away = |x: f64| {
            // A coordinate is a multiple of the step; truncation could give the index below.
            let i = (x / self.step_px).round() as usize;
            let near = &row[i.saturating_sub(reach)..(i + reach + 1).min(row.len())];
            near.iter().all(|level| *level == row[i])
        };
        let away = pixels.iter().zip(&fit.coordinates);
        away.filter(|(_, x)| is_away(**x))
            .map(|(pixel, _)| *pixel)
            .collect()
    }

    /// `None` where a list leaves nothing to check, and where its misfit is more than `most`. Coordinates
    /// take time and are looked for on demand.
    pub(super) fn fit(
        &self,
        shows: &[Option<usize>],
        pixels: &[&[f32]],
        most: f64,
        with_coordinates: bool,
    ) -> Option<Fit> {
        let known: Vec<(usize, &[f32])> = shows
            .iter()
            .enumerate()
            .filter_map(|(i, shown)| Some((i, self.rows[(*shown)?].as_deref()?)))
            .collect();
        let n = known.len();
        if n < 4 || pixels.is_empty() {
            return None;
        }
        let count = known[0].1.len();
        let (mut sums, mut squares) = (vec![0f32; count], vec![0f32; count]);
        for (_, row) in &known {
            for ((sum, square), t) in sums.iter_mut().zip(&mut squares).zip(*row) {
                *sum += t;
                *square += t * t;
            }
        }
        // Inverse deviations of the patterns at each coordinate; next to none cannot be told from noise.
        let inverse: Vec<f32> = sums
            .iter()
            .zip(&squares)
            .map(|(sum, square)| square - sum * sum / n as f32)
            .map(|deviation| {
                if deviation > 1e-3 {
                    1.0 / deviation
                } else {
                    0.0
                }
            })
            .collect();
        let most = most * pixels.len() as f64;
        let (mut misfit, mut noise) = (0.0, 0.0);
        let mut explained = vec![0f32; count];
        let mut coordinates = Vec::new();
        let mut each = Vec::with_capacity(pixels.len());
        for pixel in pixels {
            let mean = known.iter().map(|(i, _)| pixel[*i]).sum::<f32>() / n as f32;
            let total: f32 = known.iter().map(|(i, _)| (pixel[*i] - mean).powi(2)).sum();
            let most_explained = explain(&known, pixel, mean, &inverse, &mut explained);
            let best = match self.smooth {
                true => peak(&explained, most_explained),
                false => most_explained,
            };
            let (low, high) = range(pixel);
            let squared = f64::from(high - low).powi(2).max(1.0);
            let scale = squared * (n - 3) as f64;
            each.push((f64::from(total - best) / scale).clamp(0.0, CAP));
            misfit += each[each.len() - 1];
            if misfit > most {
                return None;
            }
            noise += (self.noise_dn * self.noise_dn / squared).min(CAP);
            if with_coordinates {
                let place = explained.iter().position(|here| *here == most_explained);
                coordinates.push(place.unwrap_or(0) as f64 * self.step_px);
            }
        }
        Some(Fit {
            misfit: misfit / pixels.len() as f64,
            each,
            noise: noise / pixels.len() as f64,
            good: if self.smooth { CLOSE } else { GOOD },
            shifted: shows.windows(2).any(|w| w[0] == w[1]) || shows.last() == Some(&None),
            coordinates,
        })
    }
}

/// The most that is explained between coordinates, by the parabola through the most of it at one and
/// what its neighbours explain.
fn peak(explained: &[f32], most: f32) -> f32 {
    let place = explained.iter().position(|here| *here == most);
    let before = place.and_then(|place| place.checked_sub(1));
    let three = before.and_then(|before| explained[before..].first_chunk());
    let Some([before, _, after]) = three else {
        return most;
    };
    let bend = 2.0 * most - before - after;
    match bend > 0.0 {
        true => most + (after - before).powi(2) / (8.0 * bend),
        false => most,
    }
}

/// Length in projector pixels that a pattern tells apart; `None` where it is so fine that a camera
/// may see little of it.
fn resolved_px(pattern: &Pattern) -> Option<f64> {
    let (period_px, length_px) = match *pattern {
        Pattern::Fringe { period_px, .. } => (period_px, period_px),
        Pattern::Gray { cell_px, bit, .. } => {
            let run_px = cell_px * f64::from(bit + 1).exp2();
            (2.0 * run_px, run_px)
        }
        _ => return None,
    };
    (period_px >= FINE_PX).then_some(length_px)
}

/// A pattern's level at a coordinate in projector pixels, of fringes of a contrast; none of a picture.
fn level(pattern: &Pattern, contrast: f32, x: f64) -> Option<f32> {
    let level = match *pattern {
        Pattern::Fringe {
            period_px,
            phase_rad,
            ..
        } => 0.5 + 0.5 * f64::from(contrast) * (TAU * (x / period_px).fract() + phase_rad).cos(),
        _ => pattern.level(x.round() as u32)?,
    };
    Some(level as f32)
}

widest! {
    /// What each coordinate explains of a pixel's deviations from its mean over the known frames, into a
    /// list as long as there are coordinates; the most of it.
    fn explain(
        known: &[(usize, &[f32])],
        pixel: &[f32],
        mean: f32,
        inverse: &[f32],
        explained: &mut [f32],
    ) -> f32 => explain_body
}

#[inline(always)]
fn explain_body(
    known: &[(usize, &[f32])],
    pixel: &[f32],
    mean: f32,
    inverse: &[f32],
    explained: &mut [f32],
) -> f32 {
    explained.fill(0.0);
    for (i, row) in known {
        let v = pixel[*i] - mean;
        for (product, t) in explained.iter_mut().zip(*row) {
            *product += v * t;
        }
    }
    for (product, inverse) in explained.iter_mut().zip(inverse) {
        let ahead = if *product > 0.0 { *product } else { 0.0 };
        *product = ahead * ahead * inverse;
    }
    // One for each lane, so that it vectorises.
    let mut most = [0f32; 8];
    let (lanes, rest) = explained.as_chunks::<8>();
    for lane in lanes {
        for (most, here) in most.iter_mut().zip(lane) {
            *most = if *here > *most { *here } else { *most };
        }
    }
    let all = most.iter().chain(rest);
    all.fold(0.0, |most, here| if *here > most { *here } else { most })
}
