//! How many pixels' fringe sets contradict each other by more than noise.
//!
//! Three steps of one set leave no residual, but all sets of a pixel have one mean, whatever their
//! periods: blur takes contrast and no light. The mean of each set less that of the others is noise and
//! what is the same everywhere in units of the fringes, as in `residuals`: of gains a part of the light
//! and of the fringe, of a response curve the third harmonic. (The gains are `gains`' business.)
//!
//! A patient who breathes moves within a sequence, and pixels at his outline contradict themselves: up to
//! 0.1 % of those of a ceiling pod. So single pixels are left to the decoder, which refuses each of them,
//! and a capture is refused where they are many, or where most disagree by far more than noise.

use super::residuals::{FEWEST, LEAST_DN, Left, Pixel, left};
use super::scatter::Scatter;
use phasmid_decode::{AxisPlan, FringeSet};
use rayon::prelude::*;

/// Part of the pixels whose sets may contradict each other.
const SHARE: f64 = 0.02;
/// What the means of most pixels may differ by, in deviations of a sample,
const SIGMAS: f64 = 4.0;
/// and in parts of the light: harmonics of other sets, by a response curve of 0.5.
const OF_LIGHT: f64 = 0.03;

/// Whether sets of three steps contradict the others of their axis; `noise_dn` is a sample's deviation.
pub(super) fn check(axis: &AxisPlan, noise_dn: f32, scatter: &Scatter) -> Result<(), String> {
    let sets = &axis.sets;
    if sets.len() < 2 || sets.iter().all(|set| set.frames.len() > 3) {
        return Ok(());
    }
    let pixels = solved(sets, scatter);
    if pixels.len() < FEWEST * sets.len() {
        return Ok(());
    }
    let check = |(i, set): (usize, &FringeSet)| match set.frames.len() {
        3 => held_to_others(set, i, &pixels, sets.len(), noise_dn),
        _ => Ok(()),
    };
    let found: Vec<_> = sets.par_iter().enumerate().map(check).collect();
    found.into_iter().collect()
}

/// Set `i` of so many against the others, by what is solved of the pixels.
fn held_to_others(
    set: &FringeSet,
    i: usize,
    solved: &[[f64; 3]],
    sets: usize,
    noise_dn: f32,
) -> Result<(), String> {
    let (mut lights, pixels): (Vec<f64>, Vec<Pixel>) = solved
        .chunks_exact(sets)
        .map(|pixel| held(pixel, i))
        .unzip();
    let middle = lights.len() / 2;
    let light = *lights.select_nth_unstable_by(middle, f64::total_cmp).1;
    let Left { odd, deviation_dn } = left(&pixels, [1.0, 0.0, 0.0], 0);
    let share = odd as f64 / pixels.len() as f64;
    let (first, last) = (set.frames[0], set.frames[2]);
    if deviation_dn > SIGMAS * f64::from(noise_dn) + OF_LIGHT * light {
        return Err(format!(
            "frames {first} to {last} have another mean than the other fringes: one of these or \
             those does not show its pattern"
        ));
    }
    if share > SHARE {
        return Err(format!(
            "frames {first} to {last} contradict the other fringes in {:.1} % of the pixels: rows \
             or bits of one are damaged, or something moved",
            100.0 * share
        ));
    }
    Ok(())
}

/// Mean and both parts of the fringe of each set, for lit pixels one after the other.
fn solved(sets: &[FringeSet], scatter: &Scatter) -> Vec<[f64; 3]> {
    let mut all = Vec::with_capacity(scatter.len() * sets.len());
    for values in scatter.pixels() {
        let start = all.len();
        for set in sets {
            let mut sums = [0.0; 3];
            for (weights, frame) in set.weights.iter().zip(&set.frames) {
                let value = f64::from(values[*frame]);
                for (sum, weight) in sums.iter_mut().zip(weights) {
                    *sum += weight * value;
                }
            }
            all.push(sums);
        }
        // A frame that was dark may have taken the fringe of one.
        let lit = |[_, c, s]: &[f64; 3]| c.hypot(*s) >= 2.0 * LEAST_DN;
        if !all[start..].iter().any(lit) {
            all.truncate(start);
        }
    }
    all
}

/// A pixel by what is solved of its sets: the light of the others, and the mean of set `i` less that.
fn held(solved: &[[f64; 3]], i: usize) -> (f64, Pixel) {
    let all: f64 = solved.iter().map(|[mean, ..]| mean).sum();
    let own = solved[i];
    let others = (all - own[0]) / (solved.len() as f64 - 1.0);
    (others, Pixel::new(own, own[0], vec![own[0] - others]))
}

#[cfg(test)]
mod tests {
    use super::super::scatter::FEW;
    use super::*;
    use phasmid_decode::Plan;
    use phasmid_pattern::Image;
    use phasmid_pattern::Manifest;
    use std::f64::consts::TAU;

    const SIZE: (u32, u32) = (160, 60);
    const PERIODS: [f64; 3] = [10.0, 96.0, 960.0];

    /// Three steps of three periods as a camera sees them on a surface of changing colour.
    fn capture() -> (Manifest, Vec<Image>) {
        let mut text = "[projector]\nwidth_px = 912\nheight_px = 684\n".to_owned();
        let mut frames = Vec::new();
        for k in 0..9u32 {
            let (period, phase) = (PERIODS[k as usize / 3], TAU * f64::from(k % 3) / 3.0);
            text += &format!(
                "[[frame]]\npattern = {{ kind = \"fringe\", axis = \"x\", period_px = {period}, \
                 phase_rad = {phase} }}\n"
            );
            let value = |i: u32| {
                let (u, v) = (f64::from(i % SIZE.0), f64::from(i / SIZE.0));
                let noise = f64::from((i * 9 + k).wrapping_mul(2_654_435_761) >> 16) / 65_536.0;
                let level = 0.5 + 0.4 * (TAU * (100.0 + 4.0 * u) / period + phase).cos();
                (10.0 + (100.0 + v) * level + 3.0 * noise) as u8
            };
            frames.push(
                Image::new(
                    SIZE.0 as usize,
                    SIZE.1 as usize,
                    (0..SIZE.0 * SIZE.1).map(value).collect::<Vec<u8>>(),
                )
                .unwrap(),
            );
        }
        (Manifest::parse(&text, "t").unwrap(), frames)
    }

    fn said(change: impl FnOnce(&mut [Image])) -> Option<String> {
        let (manifest, mut frames) = capture();
        change(&mut frames);
        let plan = Plan::new(&manifest).unwrap();
        let scatter = Scatter::new(&frames, FEW);
        check(&plan.axes[0], 1.0, &scatter).err()
    }

    #[test]
    fn sound_sets_and_a_few_damaged_pixels_pass() {
        assert_eq!(said(|_| {}), None);
        let few = |frames: &mut [Image]| {
            frames[1]
                .as_u8_mut()
                .unwrap()
                .iter_mut()
                .step_by(97)
                .for_each(|v| *v ^= 64);
        };
        assert_eq!(said(few), None);
    }

    #[test]
    fn many_damaged_pixels_are_told() {
        for k in [0, 4, 8] {
            let many = |frames: &mut [Image]| {
                frames[k]
                    .as_u8_mut()
                    .unwrap()
                    .iter_mut()
                    .step_by(29)
                    .for_each(|v| *v ^= 64);
            };
            let words = said(many).unwrap();
            assert!(words.contains("contradict the other fringes in"), "{words}");
        }
    }

    #[test]
    fn the_pattern_of_another_set_is_told() {
        for (k, other) in [(2, 3), (3, 2), (5, 6)] {
            let wrong = |frames: &mut [Image]| frames[k] = frames[other].clone();
            let words = said(wrong).unwrap();
            assert!(words.contains("have another mean"), "{words}");
        }
    }
}
