//! Calibration from captures of a board.

use crate::call::quiet;
use crate::documents::{Rig, from_json, to_json};
use crate::errors::raised;
use crate::results::capture_of;
use phasmid::calibrate::solve::{Choice, Errors};
use phasmid::geometry::Board;
use phasmid::geometry::board_poses::{Wanted, poses};
use phasmid::{Error, Result, Stop};
use pyo3::prelude::*;
use serde_json::json;

/// Reads a board: the name of a built-in one or its fields, in JSON, and a factor of its size.
fn board_of(json: &str, scale: f64) -> PyResult<Board> {
    let board = match json {
        "\"dots\"" => Board::DOTS,
        "\"chess\"" => Board::CHESS,
        fields => from_json(
            fields,
            "board",
            "\"dots\", \"chess\" or the fields of a board",
        )?,
    };
    let board = board.scaled(scale);
    let checked = board.check();
    checked.map_err(|(field, found, allowed)| {
        raised(Error::input(format!("board.{field}"), found, allowed))
    })?;
    Ok(board)
}

fn errors(of: &Errors) -> serde_json::Value {
    json!({ "count": of.count, "mean_px": of.mean_px, "rms_px": of.rms_px, "max_px": of.max_px })
}

/// Returns the fields of a board, as JSON.
#[pyfunction]
pub fn board(json: &str, scale: f64) -> PyResult<String> {
    to_json(&board_of(json, scale)?)
}

/// Returns positions in millimetres and rotations in degrees.
#[pyfunction]
#[pyo3(signature = (board, scale, rig, *, count, distance_mm, seed))]
pub fn board_poses(
    py: Python<'_>,
    board: &str,
    scale: f64,
    rig: &Rig,
    count: usize,
    distance_mm: Option<f64>,
    seed: u64,
) -> PyResult<Vec<([f64; 3], [f64; 3])>> {
    let (board, rig) = (board_of(board, scale)?, rig.0);
    let wanted = Wanted {
        seed,
        count,
        distance_mm,
        ..Wanted::default()
    };
    quiet(py, &Stop::default(), || {
        let poses = poses(&board, &rig, &wanted)?;
        Ok(poses.iter().map(|pose| pose.to_xyz_deg()).collect())
    })
}

/// Returns the rig, and the figures of the calibration as JSON.
#[pyfunction]
pub fn calibrate(
    py: Python<'_>,
    captures: Vec<Bound<'_, PyAny>>,
    board: &str,
    scale: f64,
    robust: bool,
) -> PyResult<(Rig, String)> {
    let board = board_of(board, scale)?;
    let captures: PyResult<Vec<_>> = captures.iter().map(capture_of).collect();
    let (captures, stop) = (captures?, Stop::default());
    let choice = Choice {
        robust,
        ..Choice::default()
    };
    let calibration = quiet(py, &stop, || -> Result<_> {
        phasmid::calibrate_with_stop(&captures, &board, choice, &stop)
    })?;
    let solution = &calibration.solution;
    let poses = solution.poses.iter().map(|pose| {
        let (position_mm, rotation_deg) = pose.camera_from_board.to_xyz_deg();
        json!({ "name": pose.name, "position_mm": position_mm, "rotation_deg": rotation_deg,
            "camera_errors": errors(&pose.camera_errors) })
    });
    let left_out = solution
        .left_out
        .iter()
        .map(|pose| (pose.name.clone(), pose.why.to_string()));
    let missed = calibration
        .missed
        .iter()
        .map(|pose| (pose.name.clone(), pose.why.to_string()));
    let parameters = solution.parameters.iter().map(|parameter| {
        json!({ "name": parameter.name, "unit": parameter.unit, "value": parameter.value,
            "sigma": parameter.sigma })
    });
    let figures = json!({
        "poses": poses.collect::<Vec<_>>(),
        "left_out": left_out.chain(missed).collect::<Vec<_>>(),
        "camera_errors": errors(&solution.camera_errors),
        "projector_errors": errors(&solution.projector_errors),
        "parameters": parameters.collect::<Vec<_>>(),
        "variance_factor": solution.variance_factor,
        "condition": solution.condition,
        "warnings": calibration.warnings,
    });
    Ok((Rig(solution.rig), figures.to_string()))
}
