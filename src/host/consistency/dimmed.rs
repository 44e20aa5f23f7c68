//! Frames that had less light than white and black.
//!
//! A lit stripe of a Gray frame is as bright as white, and the fringes' mean is about half of it, between
//! black and white. A frame that was lit for a part of its exposure has less: its bits are no longer told
//! from the middle of the two, and pixels are lost, or decoded by chance.
//!
//! A bit whose stripes the camera does not resolve lies in the middle too. So stripes have to be some
//! pixels wide, and some of the pixels dark; but for the coarsest bits, which every camera resolves.

use super::grid::Grid;
use phasmid_decode::{AxisPlan, Plan};

/// Part of the light from which on a pixel is lit; it is dark below the other.
const LIT: f32 = 0.8;
const DARK: f32 = 0.2;
/// Share of the pixels that are lit up to which a frame may be dim, and least share of those between.
const MOST_LIT: f64 = 0.05;
const LEAST_BETWEEN: f64 = 0.1;
/// Mean of fringes below which they were dim: that of a projector of gamma 2.2 is 0.36.
const LEAST_MEAN: f32 = 0.28;
/// Contrast of white and black in DN from which on a pixel is looked at, and in deviations of the noise.
const LEAST_DN: f32 = 10.0;
const LEAST_SIGMAS: f32 = 20.0;
/// Fewest pixels that tell.
const FEWEST: usize = 400;
/// Least width of stripes in pixels, and least share of dark pixels.
const LEAST_WIDTH: usize = 3;
const LEAST_DARK: f64 = 0.2;
/// Stripes that the camera hardly resolves are as far from black as from white; of dim ones the dark are
/// black. The darkest have to be nearer to black than the brightest to white, by this.
const ASYMMETRY: f32 = 0.5;
/// Bits that need neither.
const COARSE: usize = 3;

/// Whether fringes or Gray frames had distinctly less light than white, in the sequences that have
/// references.
pub(super) fn check(plan: &Plan, axis: &AxisPlan, grid: &Grid) -> Result<(), String> {
    let Some(references) = plan.white.zip(plan.black) else {
        return Ok(());
    };
    let light = Light {
        grid,
        references,
        least: LEAST_DN.max(LEAST_SIGMAS * grid.noise_dn),
    };
    for set in &axis.sets {
        let mean = |pixel: &[f32]| {
            let samples: Vec<f64> = set.frames.iter().map(|f| f64::from(pixel[*f])).collect();
            set.solve(&samples)[0] as f32
        };
        let (first, last) = (set.frames[0], set.frames[set.frames.len() - 1]);
        if let Some(mean) = light.median(mean)
            && mean < LEAST_MEAN
        {
            return Err(format!(
                "the fringes of frames {first} to {last} have {:.2} of the light that white has",
                2.0 * mean
            ));
        }
    }
    let bits = axis.gray.iter().flat_map(|code| {
        let coarse = code.bits.len().saturating_sub(COARSE);
        let bits = code.bits.iter().enumerate();
        bits.map(move |(bit, frames)| (bit >= coarse, [frames.plain, frames.inverse]))
    });
    for (coarse, frames) in bits {
        for frame in frames.into_iter().flatten() {
            if let Some(part) = light.dim(frame, coarse) {
                return Err(format!(
                    "frame {frame} has {part:.2} of the light that white has where it is lit"
                ));
            }
        }
    }
    Ok(())
}

/// Pixels by their light, between black and white.
struct Light<'a> {
    grid: &'a Grid,
    /// White and black.
    references: (usize, usize),
    least: f32,
}

impl Light<'_> {
    /// The part of the light that a pixel's value is, where the references differ enough.
    fn part(&self, pixel: &[f32], value: f32) -> Option<f32> {
        let (white, black) = (pixel[self.references.0], pixel[self.references.1]);
        (white - black >= self.least).then(|| (value - black) / (white - black))
    }

    /// The usual part of the light, of a value of each pixel.
    fn median(&self, value: impl Fn(&[f32]) -> f32) -> Option<f32> {
        let pixels = self.grid.lines.iter().flat_map(|line| line.varying());
        let parts = pixels.filter_map(|pixel| self.part(pixel, value(pixel)));
        median(parts.collect())
    }

    /// The part of the light that a frame's lit pixels have, if they are dim.
    fn dim(&self, frame: usize, coarse: bool) -> Option<f32> {
        let lines: Vec<Vec<Option<f32>>> = self
            .grid
            .lines
            .iter()
            .map(|line| {
                let part = |i: usize| {
                    let pixel = line.varies[i].then(|| line.pixel(i));
                    pixel.and_then(|pixel| self.part(pixel, pixel[frame]))
                };
                (0..line.len()).map(part).collect()
            })
            .collect();
        let parts = || lines.iter().flatten().flatten().copied();
        let all = parts().count();
        let lit = parts().filter(|part| *part > LIT).count();
        let between: Vec<f32> = parts().filter(|p| (DARK..=LIT).contains(p)).collect();
        let share = |count: usize| count as f64 / all.max(1) as f64;
        if share(lit) > MOST_LIT || share(between.len()) < LEAST_BETWEEN {
            return None;
        }
        let dim = median(between)?;
        let dark = parts().filter(|part| *part < 0.5 * dim).count();
        let edge = |pair: &[Option<f32>]| matches!(pair, [Some(a), Some(b)] if (*a < 0.5 * dim) != (*b < 0.5 * dim));
        let edges: usize = lines
            .iter()
            .map(|line| line.windows(2).filter(|pair| edge(pair)).count())
            .sum();
        let mut sorted: Vec<f32> = parts().collect();
        sorted.sort_unstable_by(f32::total_cmp);
        let [darkest, brightest] = [0.05, 0.95].map(|q| sorted[(q * (all - 1) as f64) as usize]);
        let resolved = edges * LEAST_WIDTH <= all
            && share(dark) >= LEAST_DARK
            && darkest < ASYMMETRY * (1.0 - brightest);
        (coarse || resolved).then_some(dim)
    }
}

/// The middle one of enough.
fn median(mut values: Vec<f32>) -> Option<f32> {
    if values.len() < FEWEST {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_pattern::Image;
    use phasmid_pattern::{Axis, Manifest};
    use std::f64::consts::TAU;

    /// Three fringes of 16 pixels, five bits of cells of `cell` pixels, white and black; a camera that sees
    /// `blurred` pixels as one, and frames with their light.
    fn found(cell: u32, blurred: i32, light: impl Fn(usize) -> f64) -> Result<(), String> {
        let mut text = format!("[projector]\nwidth_px = {}\nheight_px = 8\n", 32 * cell);
        for step in 0..3 {
            let phase = TAU * f64::from(step) / 3.0;
            text += &format!(
                "[[frame]]\npattern = {{ kind = \"fringe\", axis = \"x\", period_px = {cell}, phase_rad = {phase} }}\n"
            );
        }
        for bit in (0..5).rev() {
            text += &format!(
                "[[frame]]\npattern = {{ kind = \"gray\", axis = \"x\", cell_px = {cell}, bits = 5, bit = {bit} }}\n"
            );
        }
        text += "[[frame]]\npattern = { kind = \"white\" }\n[[frame]]\npattern = { kind = \"black\" }\n";
        let manifest = Manifest::parse(&text, "test").unwrap();
        let (width, height) = (32 * cell, 40u32);
        let shown = |k: usize, x: i32| match k {
            0..3 => {
                let phase = TAU * (f64::from(x) / f64::from(cell) + k as f64 / 3.0);
                0.5 + 0.5 * phase.cos()
            }
            3..8 => {
                let index = (x.clamp(0, width as i32 - 1) as u32) / cell;
                f64::from((index ^ (index >> 1)) >> (7 - k) & 1)
            }
            8 => 1.0,
            _ => 0.0,
        };
        let level = |k: usize, x: i32| {
            let seen: f64 = (0..blurred).map(|dx| shown(k, x + dx)).sum();
            (800.0 + 40_000.0 * light(k) * seen / f64::from(blurred)) as u16
        };
        let frames: Vec<Image> = (0..10)
            .map(|k| {
                Image::new(
                    width as usize,
                    height as usize,
                    (0..width * height)
                        .map(|i| level(k, (i % width) as i32))
                        .collect::<Vec<u16>>(),
                )
                .unwrap()
            })
            .collect();
        let plan = Plan::new(&manifest).unwrap();
        check(&plan, &plan.axes[0], &Grid::new(&frames, Axis::X))
    }

    #[test]
    fn frames_that_were_lit_for_a_part_are_told() {
        assert_eq!(found(16, 1, |_| 1.0), Ok(()));
        for part in [0.3, 0.5, 0.7] {
            for bad in 3..8 {
                let told = found(16, 2, |k| if k == bad { part } else { 1.0 }).unwrap_err();
                let wanted = format!("frame {bad} has {part:.2} of the light");
                assert!(told.starts_with(&wanted), "{told}");
            }
        }
        let told = found(16, 1, |k| if k < 3 { 0.4 } else { 1.0 }).unwrap_err();
        assert!(told.contains("frames 0 to 2 have 0.40"), "{told}");
    }

    #[test]
    fn bits_that_the_camera_does_not_resolve_are_not_dim() {
        for cell in [4, 5, 6] {
            for blurred in 1..20 {
                assert_eq!(found(cell, blurred, |_| 1.0), Ok(()), "{cell}, {blurred}");
            }
        }
    }
}
