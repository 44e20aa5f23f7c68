//! Alternates between solving and correcting the dot positions until they converge: [`calibrate`]
//! for a rig, [`place`] for one board with a known rig. The result of [`calibrate`] is compared with
//! the device's nominal rig: a wrong board size scales every length, which the calibration data
//! alone cannot reveal.

use super::{Calibration, Missed, PoseData, Task};
use crate::board::Seen;
use crate::board::bias::of_disc;
use crate::board::lit::unread;
use crate::solve::{self, Placed, Solution, Unsolved, solve_with_stop};
use glam::DVec2;
use phasmid_core::Stop;
use phasmid_geometry::{Board, Lens, Pose, Rig, View};

/// Points have converged if they move by less than this many pixels, a thousandth of the precision
/// of a dot's centre.
const STAYS_PX: f64 = 1e-5;
/// Maximum number of solver runs. The bias depends only weakly on lens and poses, so three runs are
/// usually enough; more may be needed if a pose is used in one run and excluded in the next.
const ROUNDS: usize = 6;

/// Solves for the rig from its poses. `missed` lists the poses without a board, for the report.
///
/// # Errors
/// Returns an error if the poses do not determine the rig, or if a stop is requested through
/// [`Task::stop`].
pub fn calibrate(
    task: &Task<'_>,
    poses: &[PoseData],
    missed: Vec<Missed>,
) -> Result<Calibration, Unsolved> {
    let mut biases: Vec<Vec<DVec2>> = poses
        .iter()
        .map(|pose| vec![DVec2::ZERO; pose.seen.len()])
        .collect();
    let (mut rounds, never) = (0, Stop::default());
    loop {
        rounds += 1;
        let sightings: Vec<_> = poses
            .iter()
            .zip(&biases)
            .map(|(pose, bias)| pose.sightings(bias))
            .collect();
        let mut solution = solve_with_stop(
            task.board,
            &sightings,
            task.camera_px,
            task.projector_px,
            &task.choice,
            task.stop.unwrap_or(&never),
        )
        .map_err(|why| with_reasons(why, poses))?;
        let next = biases_of(task.board, &solution, poses, &biases);
        let last_move_px = largest(biases.iter().flatten().zip(next.iter().flatten()));
        if last_move_px > STAYS_PX && rounds < ROUNDS {
            biases = next;
            continue;
        }
        solution.rig.noise = task.noise;
        let mut warnings = solution.warnings.clone();
        warnings.extend(unread_poses(&solution, poses));
        if last_move_px > STAYS_PX {
            warnings.push(format!(
                "the dots' centres still moved by {last_move_px:.1e} px after {rounds} rounds; \
                 expected {STAYS_PX:.0e} px or less"
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

/// Computes the pose of a board, with dot positions corrected for their bias.
///
/// # Errors
/// Returns an error in the cases of [`solve::place`].
pub fn place(board: &Board, pose: &PoseData, rig: &Rig) -> Result<Placed, Unsolved> {
    let mut biases = vec![DVec2::ZERO; pose.seen.len()];
    let mut round = 1;
    loop {
        let placed = solve::place(board, &pose.sightings(&biases), rig)?;
        let before = biases.clone();
        let at = &placed.pose.camera_from_board;
        update(&mut biases, board, &rig.camera.lens, at, &pose.seen);
        if round == ROUNDS || largest(before.iter().zip(&biases)) <= STAYS_PX {
            return Ok(placed);
        }
        round += 1;
    }
}

/// Adds the reasons for missing projector coordinates to an `Unlit` error.
fn with_reasons(why: Unsolved, poses: &[PoseData]) -> Unsolved {
    match (why, unread(poses.iter().flat_map(|pose| &pose.fits))) {
        (Unsolved::Unlit { found, wanted }, Some(reasons)) => Unsolved::Unlit {
            found: format!("{found}; {reasons}"),
            wanted,
        },
        (why, _) => why,
    }
}

/// Warnings about poses without projector coordinates.
fn unread_poses(solution: &Solution, poses: &[PoseData]) -> Vec<String> {
    let used = solution.poses.iter().filter_map(|p| poses.get(p.given));
    used.filter(|pose| pose.lit() == 0)
        .filter_map(|pose| Some((pose, unread(pose.fits.iter())?)))
        .map(|(pose, reasons)| {
            format!(
                "{} does not constrain the projector: {reasons}; the frames may not be in the \
                 sequence's order, or the projector may not light the board",
                pose.name
            )
        })
        .collect()
}

/// Computes biases from a solution. Points and poses without a new bias keep their earlier bias.
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
        let lens = &solution.rig.camera.lens;
        update(biases, board, lens, &solved.camera_from_board, &pose.seen);
    }
    biases
}

/// Updates the biases of one pose's points.
fn update(
    biases: &mut [DVec2],
    board: &Board,
    lens: &Lens,
    camera_from_board: &Pose,
    seen: &[Seen],
) {
    for (seen, bias) in seen.iter().zip(biases) {
        let radius = board.radius_mm(seen.index);
        if radius > 0.0 {
            let centre = board.point(seen.index);
            *bias = of_disc(lens, camera_from_board, centre, radius).unwrap_or(*bias);
        }
    }
}

/// Largest distance between paired points.
fn largest<'a>(pairs: impl Iterator<Item = (&'a DVec2, &'a DVec2)>) -> f64 {
    pairs.map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max)
}

/// Accepted ratio of calibrated to nominal values. A real rig may differ from its design by this
/// much.
const ALLOWED: std::ops::RangeInclusive<f64> = 0.9..=1.1;

/// Returns warnings about baseline and focal lengths that differ from nominal by more than the
/// tolerance.
fn against_nominal(rig: &Rig, nominal: &Rig) -> Vec<String> {
    let mut warnings = Vec::new();
    let baseline = |rig: &Rig| (rig.projector.center() - rig.camera.center()).length();
    let (found, wanted) = (baseline(rig), baseline(nominal));
    let factor = found / wanted;
    if !ALLOWED.contains(&factor) {
        warnings.push(format!(
            "the baseline is {found:.2} mm, {factor:.3} times the nominal {wanted:.2} mm (0.9 to \
             1.1 are usual): a board whose real pitch is {:.3} times the specified one would cause \
             this",
            1.0 / factor
        ));
    }
    for (name, found, wanted) in [
        ("camera", &rig.camera, &nominal.camera),
        ("projector", &rig.projector, &nominal.projector),
    ] {
        warnings.extend(focal_lengths(name, found, wanted));
    }
    warnings
}

fn focal_lengths(name: &str, found: &View, wanted: &View) -> Option<String> {
    let (found, wanted) = (found.lens.focal_px, wanted.lens.focal_px);
    let factor = found / wanted;
    let usual = ALLOWED.contains(&factor.x) && ALLOWED.contains(&factor.y);
    (!usual).then(|| {
        format!(
            "the {name}'s focal lengths are {:.1} and {:.1} px, {:.3} and {:.3} times the nominal \
             ones (0.9 to 1.1 are usual): another lens or zoom, or poses that do not determine them",
            found.x, found.y, factor.x, factor.y
        )
    })
}
