//! Assembles the public solution: parameters, residual statistics, condition number.

use super::bundle::{Bundle, Solved};
use super::coefficients::free;
use super::model::{State, residual};
use super::observation::{Observation, PoseObservations};
use super::solution::ProjectorResidual;
use super::{Errors, Parameter, PointResidual, Solution, SolvedPose};
use glam::DVec2;
use nalgebra::DMatrix;
use phasmid_geometry::parameters::{LENS, PARAMETERS, RIG};
use phasmid_geometry::rotation::log;
use phasmid_geometry::{Covariance, Lens, Pose, Rig, View};

pub(super) fn of(bundle: Bundle, solved: Solved) -> Solution {
    let degrees_of_freedom = bundle.degrees_of_freedom(&free(&solved.model));
    let squares: f64 = bundle.squares(&solved.state).iter().map(|s| s.0).sum();
    let Solved {
        state,
        model,
        covariance,
        inflation,
    } = solved;
    let estimated = free(&model);
    let rig_unknowns = estimated.iter().filter(|f| **f).count();
    let of_rig = covariance.view((0, 0), (rig_unknowns, rig_unknowns));
    let condition = condition(&covariance, rig_unknowns);
    let parameters = parameters(&bundle.poses, &state, &estimated, &covariance);
    let poses: Vec<SolvedPose> = bundle
        .poses
        .iter()
        .enumerate()
        .map(|(i, pose)| solved_pose(pose, &state, i))
        .collect();
    let all =
        |errors: fn(&SolvedPose) -> Vec<(DVec2, DVec2)>| gathered(poses.iter().flat_map(errors));
    let mut left_out = bundle.left_out;
    left_out.sort_by_key(|l| l.given);
    Solution {
        rig: Rig {
            camera: View {
                lens: state.camera,
                rig_from_view: Pose::IDENTITY,
            },
            projector: View {
                lens: state.projector,
                rig_from_view: state.rig_from_projector,
            },
            noise: None,
            covariance: Covariance::new(&estimated, &of_rig.into_owned()),
        },
        camera_errors: all(camera_errors),
        projector_errors: all(projector_errors),
        poses,
        left_out,
        camera_coefficients: model[0],
        projector_coefficients: model[1],
        parameters,
        condition,
        covariance,
        variance_factor: squares / degrees_of_freedom as f64,
        inflation,
        degrees_of_freedom,
        warnings: Vec::new(),
    }
}

fn parameters(
    poses: &[PoseObservations],
    state: &State,
    free: &[bool; RIG],
    covariance: &DMatrix<f64>,
) -> Vec<Parameter> {
    let of_rig = [&state.camera, &state.projector].map(Lens::parameters);
    let values = of_rig.concat().into_iter();
    let values = values.chain(of_pose(&state.rig_from_projector));
    let mut all: Vec<(String, &'static str, f64)> = PARAMETERS
        .iter()
        .zip(values)
        .map(|((name, unit), value)| ((*name).to_owned(), *unit, value))
        .collect();
    for (pose, place) in poses.iter().zip(&state.boards) {
        for ((name, unit), value) in PARAMETERS[2 * LENS..].iter().zip(of_pose(place)) {
            let name = name.trim_start_matches("projector");
            all.push((format!("{}{name}", pose.name), unit, value));
        }
    }
    all.into_iter()
        .enumerate()
        .filter(|(i, _)| *i >= RIG || free[*i])
        .enumerate()
        .map(|(at, (_, (name, unit, value)))| Parameter {
            name,
            unit,
            value,
            sigma: covariance[(at, at)].sqrt(),
        })
        .collect()
}

fn of_pose(pose: &Pose) -> [f64; 6] {
    let (turn, place) = (log(pose.rotation), pose.translation_mm);
    [turn.x, turn.y, turn.z, place.x, place.y, place.z]
}

pub(super) fn solved_pose(pose: &PoseObservations, state: &State, board: usize) -> SolvedPose {
    let points: Vec<PointResidual> = pose
        .points
        .iter()
        .filter_map(|o| point(o, state, board))
        .collect();
    let mut solved = SolvedPose {
        name: pose.name.clone(),
        given: pose.given,
        camera_from_board: state.boards[board],
        camera_errors: Errors::default(),
        projector_errors: Errors::default(),
        points,
    };
    solved.camera_errors = gathered(camera_errors(&solved).into_iter());
    solved.projector_errors = gathered(projector_errors(&solved).into_iter());
    solved
}

fn point(o: &Observation, state: &State, board: usize) -> Option<PointResidual> {
    let r = residual(o, state, board)?;
    let w = r.whitened(o);
    Some(PointResidual {
        index: o.index,
        camera_px: r.camera.to_array(),
        camera_whitened: w.camera.to_array(),
        camera_weight: f64::from(u8::from(o.camera_counts)),
        projector: r
            .projector
            .zip(w.projector)
            .map(|(px, whitened)| ProjectorResidual {
                px: px.to_array(),
                whitened: whitened.to_array(),
                weight: f64::from(u8::from(o.projector_counts)),
            }),
    })
}

/// Returns the residuals of the inliers, in pixels and whitened.
fn camera_errors(pose: &SolvedPose) -> Vec<(DVec2, DVec2)> {
    let points = pose.points.iter().filter(|p| p.camera_weight > 0.0);
    let pair = |p: &PointResidual| (p.camera_px.into(), p.camera_whitened.into());
    points.map(pair).collect()
}

fn projector_errors(pose: &SolvedPose) -> Vec<(DVec2, DVec2)> {
    let parts = pose.points.iter().filter_map(|p| p.projector);
    let parts = parts.filter(|p| p.weight > 0.0);
    parts.map(|p| (p.px.into(), p.whitened.into())).collect()
}

fn gathered(errors: impl Iterator<Item = (DVec2, DVec2)>) -> Errors {
    let (mut all, mut squares, mut whitened) = (Errors::default(), 0.0, 0.0);
    for (px, w) in errors {
        let length = px.length();
        all.count += 1;
        all.mean_px += length;
        all.max_px = all.max_px.max(length);
        squares += length * length;
        whitened += w.length_squared() / 2.0;
    }
    let count = (all.count as f64).max(1.0);
    all.mean_px /= count;
    all.rms_px = (squares / count).sqrt();
    all.whitened_rms = (whitened / count).sqrt();
    all
}

/// Condition number of the correlation matrix of the first `count` unknowns.
fn condition(covariance: &DMatrix<f64>, count: usize) -> f64 {
    let sigma: Vec<f64> = (0..count).map(|i| covariance[(i, i)].sqrt()).collect();
    let correlation = DMatrix::from_fn(sigma.len(), sigma.len(), |i, j| {
        covariance[(i, j)] / (sigma[i] * sigma[j])
    });
    if correlation.iter().any(|x| !x.is_finite()) {
        return f64::INFINITY;
    }
    match correlation.try_symmetric_eigen(1e-15, 10_000) {
        Some(eigen) => {
            let least = eigen.eigenvalues.min();
            if least > 0.0 {
                eigen.eigenvalues.max() / least
            } else {
                f64::INFINITY
            }
        }
        None => f64::INFINITY,
    }
}
