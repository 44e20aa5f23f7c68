//! Pose of a board for a known rig.

use super::PoseData;
use super::rounds::{ROUNDS, STAYS_PX, largest, update};
use crate::solve::{self, Placed, Unsolved};
use glam::DVec2;
use phasmid_geometry::{Board, Rig};

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
