//! Covariance that a calibration with a board will have, from the geometry alone: the inverse of
//! the normal matrix of bundle adjustment, with the poses of the board eliminated (Triggs et al.,
//! "Bundle adjustment: a modern synthesis", 2000, section 6.1).

use super::parameters::{LENS, RIG, by_motion};
use super::{Covariance, Rig};
use crate::{Board, Pose, View};
use glam::{DMat2, DVec2, DVec3};
use nalgebra::{DMatrix, Matrix6, MatrixXx6};
use rayon::prelude::*;

/// Number of parameters that a point depends on: the rig's and the six of the board's pose.
const ALL: usize = RIG + 6;

impl Covariance {
    /// Predicts the covariance of a calibration of `rig` in which the camera sees `board` in the poses
    /// `rig_from_board`. Errors of a board point's camera pixel have sigma `corner_px` along either
    /// axis. The projector's coordinate is read at the pixel found, so its error is the pixel's error,
    /// converted to the projector's pixels, plus an independent error of sigma `corner_px`. Points
    /// outside a view's image are not used. Returns `None` if the poses do not determine the parameters
    /// in `estimated`.
    pub fn of_calibration(
        rig: &Rig,
        board: &Board,
        rig_from_board: &[Pose],
        corner_px: f64,
        estimated: &[bool; RIG],
    ) -> Option<Self> {
        let at: Vec<usize> = (0..RIG).filter(|i| estimated[*i]).collect();
        let count = at.len();
        let information: Vec<DMatrix<f64>> = rig_from_board
            .par_iter()
            .map(|pose| {
                let normal = normal(rig, board, pose);
                let own = Matrix6::from_fn(|i, j| normal[RIG + i][RIG + j]);
                let shared = MatrixXx6::from_fn(count, |i, j| normal[at[i]][RIG + j]);
                let rig = DMatrix::from_fn(count, count, |i, j| normal[at[i]][at[j]]);
                // A pose with too few visible points gives no information about the rig.
                own.cholesky().map_or(DMatrix::zeros(count, count), |own| {
                    rig - &shared * own.inverse() * shared.transpose()
                })
            })
            .collect();
        let mut sum = DMatrix::zeros(count, count);
        for part in information {
            sum += part;
        }
        // Scale to a unit diagonal, because the units differ by orders of magnitude.
        let scale: Vec<f64> = sum.diagonal().iter().map(|v| v.sqrt()).collect();
        let scaled = |m: &DMatrix<f64>| {
            DMatrix::from_fn(count, count, |i, j| m[(i, j)] / (scale[i] * scale[j]))
        };
        let inverse = scaled(&((&sum + sum.transpose()) * 0.5))
            .cholesky()?
            .inverse();
        Self::new(estimated, &(scaled(&inverse) * (corner_px * corner_px)))
    }
}

/// Normal matrix of a pose's points, for errors of 1 px.
fn normal(rig: &Rig, board: &Board, rig_from_board: &Pose) -> Box<[[f64; ALL]; ALL]> {
    let camera_from_rig = rig.camera.rig_from_view.inverse();
    let camera_from_board = camera_from_rig * *rig_from_board;
    let camera_from_projector = camera_from_rig * rig.projector.rig_from_view;
    let mut sum = Box::new([[0.0; ALL]; ALL]);
    let is_inside = |view: &View, point: DVec3| {
        let px = view.project(rig.camera.rig_from_view.point(point));
        px.is_some_and(|px| view.lens.contains(px))
    };
    for index in board.indices() {
        let arm = camera_from_board.direction(board.point(index).extend(0.0));
        let point = arm + camera_from_board.translation_mm;
        let Some(seen) = rig.camera.lens.sight(point) else {
            continue;
        };
        if !is_inside(&rig.camera, point) {
            continue;
        }
        let mut camera = [DVec2::ZERO; ALL];
        camera[..LENS].copy_from_slice(&seen.by_lens);
        by_motion(&seen.by_point, arm, &mut camera[RIG..]);
        add(&mut sum, &camera);

        let arm_of_projector = point - camera_from_projector.translation_mm;
        let from_camera = camera_from_projector.rotation.transpose();
        let lit = rig.projector.lens.sight(from_camera * arm_of_projector);
        let Some(lit) = lit.filter(|_| is_inside(&rig.projector, point)) else {
            continue;
        };
        let by_point = lit.by_point.map(|row| camera_from_projector.rotation * row);
        let mut projector = [DVec2::ZERO; ALL];
        projector[LENS..2 * LENS].copy_from_slice(&lit.by_lens);
        // The projector moves and the point stays, hence the opposite sign.
        by_motion(&by_point, arm_of_projector, &mut projector[2 * LENS..RIG]);
        for column in &mut projector[2 * LENS..RIG] {
            *column = -*column;
        }
        by_motion(&by_point, arm, &mut projector[RIG..]);
        // Derivative of the projector's coordinate by the camera's pixel on the board.
        let along = [DVec3::X, DVec3::Y].map(|axis| camera_from_board.direction(axis));
        let on_board = |rows: &[DVec3; 2]| {
            DMat2::from_cols_array_2d(&along.map(|d| [rows[0].dot(d), rows[1].dot(d)]))
        };
        let slope = on_board(&by_point) * on_board(&seen.by_point).inverse();
        if !slope.is_finite() {
            continue;
        }
        for (p, c) in projector.iter_mut().zip(&camera) {
            *p -= slope * *c;
        }
        add(&mut sum, &projector);
    }
    sum
}

fn add(sum: &mut [[f64; ALL]; ALL], columns: &[DVec2; ALL]) {
    for (row, a) in sum.iter_mut().zip(columns) {
        if *a != DVec2::ZERO {
            for (m, b) in row.iter_mut().zip(columns) {
                *m += a.dot(*b);
            }
        }
    }
}
