//! Finds saddle points, where two dark and two light sectors meet.
//!
//! The Hessian's determinant is most negative at a saddle of the smoothed image (Chen and Zhang, "A
//! new sub-pixel detector for X-corners in camera calibration targets", WSCG 2005). A ring of
//! samples around it must then change between dark and light exactly four times, with opposite
//! sectors of similar width. The threshold comes from the ring's own levels, so that uneven light
//! has little effect.

use super::grey::Grey;
use glam::DVec2;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Maximum number of saddles; the strongest are kept.
const MOST: usize = 4000;
const RING: usize = 32;
/// Radius of the ring in pixels.
const RADIUS: f64 = 3.0;
/// Minimum width of a sector, and maximum difference between the widths of opposite sectors, in
/// radians.
const NARROWEST: f64 = 0.4;
const UNLIKE: f64 = 0.5;

/// A candidate corner.
#[derive(Debug, Clone, Copy)]
pub(super) struct Saddle {
    pub(super) px: DVec2,
    /// Directions of the four edges, clockwise in the image; the sector from the first to the
    /// second is dark.
    pub(super) edges: [DVec2; 4],
    /// Mean level of the light sectors minus mean level of the dark sectors.
    pub(super) contrast: f32,
}

/// Finds the saddles of a smoothed image.
pub(super) fn saddles(grey: &Grey) -> Vec<Saddle> {
    let mut found = peaks(grey);
    found.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    found.truncate(MOST);
    found.sort_by_key(|f| f.0);
    let judged = found.par_iter().filter_map(|&(at, _)| {
        let (x, y) = (at % grey.width, at / grey.width);
        ring(grey, refine(grey, x, y)?)
    });
    judged.collect()
}

/// Second derivatives fxx, fyy, fxy.
fn hessian(level: &[f32], width: usize, at: usize) -> [f32; 3] {
    let (up, down) = (at - width, at + width);
    let twice = 2.0 * level[at];
    [
        level[at + 1] + level[at - 1] - twice,
        level[up] + level[down] - twice,
        0.25 * (level[down + 1] + level[up - 1] - level[down - 1] - level[up + 1]),
    ]
}

/// Returns each pixel whose Hessian determinant is the most negative of its 5 x 5 neighbourhood,
/// with the determinant's absolute value.
fn peaks(grey: &Grey) -> Vec<(usize, f32)> {
    let (w, h) = (grey.width, grey.height);
    if w < 9 || h < 9 {
        return Vec::new();
    }
    let mut strength = vec![0.0_f32; w * h];
    let inner = strength.par_chunks_mut(w).enumerate().skip(1).take(h - 2);
    inner.for_each(|(y, out)| {
        for x in 1..w - 1 {
            let [xx, yy, xy] = hessian(&grey.level, w, y * w + x);
            out[x] = xy * xy - xx * yy;
        }
    });
    // In pure noise, the determinant rarely reaches the unsmoothed noise variance.
    let unsmoothed = grey.noise / super::grey::SMOOTHED;
    let least = (unsmoothed * unsmoothed).max(1e-12);
    let rows = (4..h - 4).into_par_iter().flat_map_iter(|y| {
        let strength = &strength;
        (4..w - 4).filter_map(move |x| {
            let at = y * w + x;
            let here = strength[at];
            if !(here > least && here >= strength[at - 1] && here >= strength[at + 1]) {
                return None;
            }
            // The last of several equal values is the peak.
            let peak = (0..5).all(|j| {
                let from = (y + j - 2) * w + x - 2;
                (from..from + 5).all(|i| strength[i] < here || (strength[i] == here && i <= at))
            });
            peak.then_some((at, here))
        })
    });
    rows.collect()
}

/// Refines a saddle to subpixel position by a quadratic through the pixel's neighbours.
fn refine(grey: &Grey, x: usize, y: usize) -> Option<DVec2> {
    let at = y * grey.width + x;
    let [xx, yy, xy] = hessian(&grey.level, grey.width, at).map(f64::from);
    let level = |i: usize| f64::from(grey.level[i]);
    let slope = DVec2::new(
        0.5 * (level(at + 1) - level(at - 1)),
        0.5 * (level(at + grey.width) - level(at - grey.width)),
    );
    let determinant = xx * yy - xy * xy;
    let step = -DVec2::new(yy * slope.x - xy * slope.y, xx * slope.y - xy * slope.x) / determinant;
    (step.is_finite() && step.length() < 2.0).then(|| DVec2::new(x as f64, y as f64) + step)
}

fn ring(grey: &Grey, px: DVec2) -> Option<Saddle> {
    let mut samples = [0.0_f32; RING];
    for (i, sample) in samples.iter_mut().enumerate() {
        *sample = grey.between(px + DVec2::from_angle(TAU * i as f64 / RING as f64) * RADIUS)?;
    }
    // Set the threshold half-way between the means of the lighter half and of the darker half of
    // the samples.
    let mut sorted = samples;
    sorted.sort_by(f32::total_cmp);
    let mean = |s: &[f32]| s.iter().sum::<f32>() / s.len() as f32;
    let (dark, light) = (mean(&sorted[..RING / 2]), mean(&sorted[RING / 2..]));
    let contrast = light - dark;
    if !(contrast > 0.08 * light.abs() && contrast > 5.0 * grey.noise) {
        return None;
    }
    let middle = 0.5 * (dark + light);
    let mut crossings = [(0.0, false); 4];
    let mut count = 0;
    for i in 0..RING {
        let (a, b) = (samples[i], samples[(i + 1) % RING]);
        if (a < middle) != (b < middle) {
            let part = f64::from((middle - a) / (b - a));
            *crossings.get_mut(count)? = (TAU * (i as f64 + part) / RING as f64, b < middle);
            count += 1;
        }
    }
    if count != 4 {
        return None;
    }
    // Start with a transition from light to dark.
    if !crossings[0].1 {
        crossings.rotate_left(1);
    }
    let angles = crossings.map(|c| c.0);
    let width = |i: usize| (angles[(i + 1) % 4] - angles[i]).rem_euclid(TAU);
    let widths = [0, 1, 2, 3].map(width);
    let like = |i: usize| (widths[i] - widths[i + 2]).abs() < UNLIKE;
    if !(widths.iter().all(|&w| w > NARROWEST) && like(0) && like(1)) {
        return None;
    }
    // Opposite edges lie on one line. Its direction is the mean of the two edges' directions.
    let line = |i: usize| {
        let off = (angles[i + 2] - angles[i]).rem_euclid(TAU) - PI;
        DVec2::from_angle(angles[i] + 0.5 * off)
    };
    let (first, second) = (line(0), line(1));
    Some(Saddle {
        px,
        edges: [first, second, -first, -second],
        contrast,
    })
}
