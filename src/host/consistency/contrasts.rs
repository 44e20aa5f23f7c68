//! How much of its contrast each set of fringes has left.
//!
//! A camera's and a projector's blur take contrast from fine fringes and none from coarse ones, much the
//! same everywhere in an image. The modulation of equal steps is the same in any order of them, so it
//! may be asked before the order is known.

use super::grid::Grid;
use phasmid_decode::AxisPlan;
use phasmid_pattern::{Manifest, Pattern};

/// Pixels that are looked at, at most.
const PIXELS: usize = 500;

/// The contrast of each frame's fringes in parts of the most that a set has, of sequences that have
/// nothing but fringes; 1 for those of the other axis.
pub(super) fn contrasts(manifest: &Manifest, axis: &AxisPlan, grid: &Grid) -> Option<Vec<f32>> {
    let mut all = vec![1.0; manifest.frame.len()];
    let mut patterns = manifest.frame.iter().map(|frame| &frame.pattern);
    if axis.sets.len() < 2 || !patterns.all(|pattern| matches!(pattern, Pattern::Fringe { .. })) {
        return None;
    }
    let mut parts: Vec<Vec<f64>> = vec![Vec::new(); axis.sets.len()];
    for pixel in grid.sample(PIXELS) {
        let modulations = axis.sets.iter().map(|set| {
            let samples: Vec<f64> = set.frames.iter().map(|f| f64::from(pixel[*f])).collect();
            let [_, c, s] = set.solve(&samples);
            c.hypot(s)
        });
        let modulations: Vec<f64> = modulations.collect();
        let most = modulations.iter().copied().fold(0.0, f64::max);
        for (parts, modulation) in parts.iter_mut().zip(modulations) {
            parts.push(modulation / most.max(1e-9));
        }
    }
    for (set, mut parts) in axis.sets.iter().zip(parts) {
        if parts.is_empty() {
            continue;
        }
        let middle = parts.len() / 2;
        let part = *parts.select_nth_unstable_by(middle, f64::total_cmp).1;
        for frame in &set.frames {
            all[*frame] = part as f32;
        }
    }
    Some(all)
}
