//! The image in which a board is searched, combined from the frames of a sequence.
//!
//! Frames are combined in groups whose mean does not depend on the projected pattern: the mean A of
//! a fringe set, by least squares over its steps ([`FringeSet`]); a Gray-code bit with its
//! complement; a white frame; a black frame, lit by ambient light. Each group sees the same board
//! with its own signal s and variance v. The sum with weights proportional to s / v has the best
//! signal-to-noise ratio (maximal ratio combining; Brennan, "Linear diversity combining
//! techniques", Proc. IRE 47, 1959). All pixels have the same weights, so that the sum stays linear
//! in light.
//!
//! The submodule `rounding` computes the variance that rounding causes in frames that all show the
//! same level.

mod rounding;
#[cfg(test)]
mod tests;

use phasmid_core::error::{Error, Result};
use phasmid_decode::FringeSet;
use phasmid_geometry::NoiseModel;
use phasmid_pattern::{Axis, Image, Manifest, Pattern, Samples};
use rayon::prelude::*;
use rounding::{ON_OUTLINES, left_by_rounding, same};

/// One image combined from all frames of a pose: linear in light, with a noise estimate.
#[derive(Debug, Clone, PartialEq)]
pub struct BoardImage {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Signal above black in DN of one frame, row by row; NaN where a frame is saturated.
    pub level: Vec<f32>,
    /// Variance of each level, in DN squared.
    pub variance: Vec<f32>,
}

/// Approximate number of pixels that the groups' signals are estimated from.
const LOOKED_AT: usize = 40_000;

/// Frame indices and their weights, which sum to 1.
struct Group {
    frames: Vec<(usize, f64)>,
}

impl BoardImage {
    /// Combines all frames of a sequence whose sum does not depend on the projected pattern:
    /// complete fringe sets, Gray-code bits with their complements, white and black frames. Frames
    /// that were not loaded (empty), pattern images, and incomplete fringe sets or bits are left
    /// out. A single photograph is a sequence of one white frame.
    ///
    /// # Errors
    /// Returns an error if the number of frames differs from the manifest's, if the sequence
    /// contains no such group, or if every pixel is saturated in some frame.
    pub fn from_frames(manifest: &Manifest, images: &[Image], noise: &NoiseModel) -> Result<Self> {
        if images.len() != manifest.frame.len() {
            return Err(Error::input(
                "frames",
                format!("{} frames", images.len()),
                format!(
                    "{} frames, one per pattern of the sequence",
                    manifest.frame.len()
                ),
            ));
        }
        let size @ [width, height] = Image::common_size(images)?;
        let groups = groups(manifest, images);
        if groups.is_empty() {
            return Err(Error::input(
                "sequence",
                format!(
                    "no frame that shows a board, of {} frames of {width} x {height} pixels",
                    images.len()
                ),
                "a white frame, 3 or more steps of a fringe, or a Gray bit with its complement",
            ));
        }
        let strengths = strengths(&groups, size, images, noise).ok_or_else(|| {
            Error::input(
                "frames",
                format!(
                    "every pixel at {} or more in some frame",
                    noise.saturation_dn
                ),
                "pixels that are not saturated: a shorter exposure",
            )
        })?;
        Ok(combine(&groups, &strengths, size, images, noise))
    }
}

impl BoardImage {
    /// Creates a board image from a single photograph by any camera, without a pattern sequence.
    ///
    /// # Errors
    /// Returns an error if the image has no pixels.
    pub fn from_photograph(image: &Image, noise: &NoiseModel) -> Result<Self> {
        let images = std::slice::from_ref(image);
        let size = Image::common_size(images)?;
        let group = Group {
            frames: vec![(0, 1.0)],
        };
        Ok(combine(&[group], &[1.0], size, images, noise))
    }
}

/// Groups the frames of a sequence.
fn groups(manifest: &Manifest, images: &[Image]) -> Vec<Group> {
    let mut groups = Vec::new();
    let mut fringes: Vec<(Axis, f64, Vec<usize>, Vec<f64>)> = Vec::new();
    let mut bits: Vec<(Axis, f64, u32, [Vec<usize>; 2])> = Vec::new();
    for (i, frame) in manifest.frame.iter().enumerate() {
        if images[i].is_empty() {
            continue;
        }
        match frame.pattern {
            Pattern::Fringe {
                axis,
                period_px,
                phase_rad,
            } => {
                let near =
                    |g: &(Axis, f64, _, _)| g.0 == axis && (g.1 / period_px - 1.0).abs() < 1e-6;
                let at = fringes.iter().position(near).unwrap_or_else(|| {
                    fringes.push((axis, period_px, Vec::new(), Vec::new()));
                    fringes.len() - 1
                });
                fringes[at].2.push(i);
                fringes[at].3.push(phase_rad);
            }
            Pattern::Gray {
                axis,
                cell_px,
                bit,
                inverted,
                ..
            } => {
                let same = |g: &(Axis, f64, u32, _)| g.0 == axis && g.1 == cell_px && g.2 == bit;
                let at = bits.iter().position(same).unwrap_or_else(|| {
                    bits.push((axis, cell_px, bit, [Vec::new(), Vec::new()]));
                    bits.len() - 1
                });
                bits[at].3[usize::from(inverted)].push(i);
            }
            Pattern::White {} | Pattern::Black {} => groups.push(Group {
                frames: vec![(i, 1.0)],
            }),
            Pattern::Image { .. } => {}
        }
    }
    for (axis, period, frames, phases) in fringes {
        // Leave out steps that do not determine the mean.
        if let Ok(set) = FringeSet::new(&format!("axis {axis}"), period, frames, phases) {
            let weights = set.weights.iter().map(|w| w[0]);
            groups.push(Group {
                frames: set.frames.iter().copied().zip(weights).collect(),
            });
        }
    }
    for (_, _, _, [plain, inverse]) in bits {
        let pairs = plain.into_iter().zip(inverse);
        groups.extend(pairs.map(|(p, q)| Group {
            frames: vec![(p, 0.5), (q, 0.5)],
        }));
    }
    groups
}

/// Weights of the groups, which sum to 1; `None` if every pixel is saturated in some frame.
fn strengths(
    groups: &[Group],
    [width, height]: [usize; 2],
    images: &[Image],
    noise: &NoiseModel,
) -> Option<Vec<f64>> {
    let pixels = width * height;
    let mut sums = vec![0.0; groups.len()];
    let mut count = 0.0;
    let mut means = vec![0.0; groups.len()];
    // Look at a subset of the pixels first. If all pixels of the subset are saturated, look at
    // every pixel.
    for stride in [(pixels / LOOKED_AT).max(1), 1] {
        'pixels: for i in (0..pixels).step_by(stride) {
            for (mean, group) in means.iter_mut().zip(groups) {
                *mean = 0.0;
                for &(frame, weight) in &group.frames {
                    let dn = f64::from(images[frame].value(i));
                    if dn >= noise.saturation_dn {
                        continue 'pixels;
                    }
                    *mean += weight * dn;
                }
            }
            count += 1.0;
            sums.iter_mut().zip(&means).for_each(|(s, m)| *s += m);
        }
        if count > 0.0 {
            break;
        }
    }
    if count == 0.0 {
        return None;
    }
    let weights: Vec<f64> = groups
        .iter()
        .zip(sums)
        .map(|(group, sum)| {
            let mean = sum / count;
            (mean - noise.black_level_dn).max(0.0) / (spread(group) * noise.variance_dn2(mean))
        })
        .collect();
    let total: f64 = weights.iter().sum();
    Some(if total > 0.0 && total.is_finite() {
        weights.iter().map(|w| w / total).collect()
    } else {
        // Without any signal, all weights are equally good.
        vec![1.0 / groups.len() as f64; groups.len()]
    })
}

/// Ratio of the variance of a group's weighted mean to the variance of one sample.
fn spread(group: &Group) -> f64 {
    group.frames.iter().map(|(_, w)| w * w).sum()
}

fn combine(
    groups: &[Group],
    strengths: &[f64],
    [width, height]: [usize; 2],
    images: &[Image],
    noise: &NoiseModel,
) -> BoardImage {
    let mut level = vec![0.0_f32; width * height];
    let mut variance = vec![0.0_f32; width * height];
    let rows = level
        .par_chunks_mut(width)
        .zip(variance.par_chunks_mut(width));
    rows.enumerate().for_each(|(row, (level, variance))| {
        let span = row * width..(row + 1) * width;
        let (black, saturation) = (noise.black_level_dn as f32, noise.saturation_dn as f32);
        let mut mean = vec![0.0_f32; width];
        let mut range = vec![[f32::INFINITY, f32::NEG_INFINITY]; width];
        for (group, &strength) in groups.iter().zip(strengths) {
            mean.fill(-black);
            for &(frame, weight) in &group.frames {
                let weight = weight as f32;
                let add = |((sum, range), dn): ((&mut f32, &mut [f32; 2]), f32)| {
                    *range = [range[0].min(dn), range[1].max(dn)];
                    *sum += if dn >= saturation {
                        f32::NAN
                    } else {
                        weight * dn
                    };
                };
                match images[frame].samples() {
                    Samples::U8(s) => mean
                        .iter_mut()
                        .zip(&mut range)
                        .zip(s[span.clone()].iter().map(|&v| f32::from(v)))
                        .for_each(add),
                    Samples::U16(s) => mean
                        .iter_mut()
                        .zip(&mut range)
                        .zip(s[span.clone()].iter().map(|&v| f32::from(v)))
                        .for_each(add),
                }
            }
            let share = (strength * strength * spread(group)) as f32;
            let floor = noise.variance_dn2(noise.black_level_dn) as f32;
            let (strength, gain) = (strength as f32, noise.gain_dn_per_e as f32);
            for ((level, variance), mean) in level.iter_mut().zip(variance.iter_mut()).zip(&mean) {
                *level += strength * mean;
                *variance += share * (floor + gain * mean.max(0.0));
            }
        }
        // Outside the projector's light, all frames show the same level and round alike, so
        // rounding errors do not average out. The variance computed above treats these errors as
        // independent; add the part that is common to all frames.
        let own: f64 = groups
            .iter()
            .zip(strengths)
            .map(|(g, s)| s * s * spread(g))
            .sum();
        let common = (1.0 - own).max(0.0) as f32;
        for ((level, variance), [low, high]) in level.iter().zip(variance).zip(range) {
            let one = (noise.read_noise_dn.powi(2)
                + noise.gain_dn_per_e * f64::from(level.max(0.0))) as f32;
            if same(low, high, one) {
                *variance += common * ON_OUTLINES * left_by_rounding(one);
            }
        }
    });
    BoardImage {
        width,
        height,
        level,
        variance,
    }
}
