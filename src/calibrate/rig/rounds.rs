//! Solving and moving points in turn, until they stay.

use super::checks::against_nominal;
use super::{Calibration, Missed, PoseData, Task};
use crate::calibrate::board::bias::of_disc;
use crate::calibrate::solve::{Solution, Unsolved, solve};
use crate::geometry::Board;
use glam::DVec2;

/// Below this nothing moves that matters: a thousandth of what a dot's centre is known by.
const STAYS_PX: f64 = 1e-5;
/// The bias depends on the lens and the poses so little that three are enough; a pose that comes and
/// goes could take more.
const ROUNDS: usize = 6;

/// Solves for the rig of a task from its poses; `missed` are those without a board, for the report.
///
/// # Errors
/// What leaves a part of the rig undetermined.
pub fn calibrate(
    task: &Task<'_>,
    poses: &[PoseData],
    missed: Vec<Missed>,
) -> Result<Calibration, Unsolved> {
    let mut biases: Vec<Vec<DVec2>> = poses
        .iter()
        .map(|pose| vec![DVec2::ZERO; pose.seen.len()])
        .collect();
    let mut rounds = 0;
    loop {
        rounds += 1;
        let sightings: Vec<_> = poses
            .iter()
            .zip(&biases)
            .map(|(pose, bias)| pose.sightings(bias))
            .collect();
        let mut solution = solve(
            task.board,
            &sightings,
            task.camera_px,
            task.projector_px,
            &task.choice,
        )?;
        let next = biases_of(task.board, &solution, poses, &biases);
        let last_move_px = largest(biases.iter().flatten().zip(next.iter().flatten()));
        if last_move_px > STAYS_PX && rounds < ROUNDS {
            biases = next;
            continue;
        }
        solution.rig.noise = task.noise;
        let mut warnings = solution.warnings.clone();
        if last_move_px > STAYS_PX {
            warnings.push(format!(
                "the dots' centres still moved by {last_move_px:.1e} px after {rounds} rounds; \
                 {STAYS_PX:.0e} px were wanted"
            ));
        }
        if let Some(nominal) = task.nominal {
            warnings.extend(against_nominal(&solution.rig, nominal));
        }
        let zero = DVec2::ZERO;
        return Ok(Calibration {
            board: *task.board,
            solution,
            sightings,
            missed,
            rounds,
            largest_bias_px: largest(biases.iter().flatten().map(|bias| (bias, &zero))),
            last_move_px,
            warnings,
        });
    }
}

/// The biases by a solution; those of poses and points that it cannot tell stay as they are.
fn biases_of(
    board: &Board,
    solution: &Solution,
    poses: &[PoseData],
    before: &[Vec<DVec2>],
) -> Vec<Vec<DVec2>> {
    let mut biases = before.to_vec();
    for solved in &solution.poses {
        let (Some(pose), Some(biases)) = (poses.get(solved.given), biases.get_mut(solved.given))
        else {
            continue;
        };
        for (seen, bias) in pose.seen.iter().zip(biases) {
            let radius = board.radius_mm(seen.index);
            if radius > 0.0 {
                let lens = &solution.rig.camera.lens;
                let centre = board.point(seen.index);
                *bias = of_disc(lens, &solved.camera_from_board, centre, radius).unwrap_or(*bias);
            }
        }
    }
    biases
}

fn largest<'a>(pairs: impl Iterator<Item = (&'a DVec2, &'a DVec2)>) -> f64 {
    pairs.map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max)
}
