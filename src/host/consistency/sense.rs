//! Which way fringes run, against the Gray code.
//!
//! Along a line of the image the code counts up or down, and the phase of the fringes grows or falls
//! with it. Two exchanged steps of three, or the first and third of four, turn the phase round and leave
//! no residual: the picture is mirrored within each period, where the code has nothing to say.

use super::gray::word;
use super::grid::Grid;
use phasmid_decode::{AxisPlan, FringeSet, GrayCode};
use phasmid_pattern::gray_decode;
use std::f64::consts::{PI, TAU};

/// Neighbours that have to be looked at.
const LEAST: usize = 400;
/// Part of all steps by which one way has to outweigh the other.
const CLEAR: f64 = 0.5;
/// Part of a period that neighbours may be apart: a camera that sees fewer pixels of a period may see
/// it run backwards.
const APART: f64 = 0.25;
/// Cells of the code that neighbours may be apart; what is farther is a step in depth.
const CELLS: u64 = 2;

/// Steps from neighbour to neighbour.
#[derive(Default)]
struct Steps {
    sum: f64,
    sizes: f64,
}

impl Steps {
    fn add(&mut self, step: f64) {
        self.sum += step;
        self.sizes += step.abs();
    }

    /// Which way, where that is clear.
    fn way(&self) -> Option<f64> {
        (self.sum.abs() > CLEAR * self.sizes).then(|| self.sum.signum())
    }
}

/// Whether a set of up to four steps runs against the code; more steps leave a residual.
pub(super) fn check(axis: &AxisPlan, grid: &Grid) -> Result<(), String> {
    let Some(code) = &axis.gray else {
        return Ok(());
    };
    for set in axis.sets.iter().filter(|set| set.frames.len() < 5) {
        if runs_against(set, code, grid) {
            let (first, last) = (set.frames[0], set.frames[set.frames.len() - 1]);
            return Err(format!(
                "the fringes of frames {first} to {last} run against the code: two of them look exchanged"
            ));
        }
    }
    Ok(())
}

fn runs_against(set: &FringeSet, code: &GrayCode, grid: &Grid) -> bool {
    let look = |values: &[f32]| -> (u64, f64) {
        let samples: Vec<f64> = set.frames.iter().map(|f| f64::from(values[*f])).collect();
        let [_, c, s] = set.solve(&samples);
        (gray_decode(word(code, values)), s.atan2(c))
    };
    let (mut by_code, mut by_phase) = (Steps::default(), Steps::default());
    let mut all = 0usize;
    for line in &grid.lines {
        let mut before: Option<(u64, f64)> = None;
        for i in 0..line.len() {
            let now = line.varies[i].then(|| look(line.pixel(i)));
            if let (Some((cell, phase)), Some((next, later))) = (before, now)
                && next.abs_diff(cell) <= CELLS
            {
                by_code.add((next as f64 - cell as f64) * code.cell_px);
                let turn = (later - phase + PI).rem_euclid(TAU) - PI;
                by_phase.add(turn / TAU * set.period_px);
                all += 1;
            }
            before = now;
        }
    }
    let apart = by_code.sum.abs() / all.max(1) as f64;
    let ways = by_code.way().zip(by_phase.way());
    all >= LEAST && apart < APART * set.period_px && ways.is_some_and(|(a, b)| a != b)
}
