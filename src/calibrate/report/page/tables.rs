//! Tables of parameters and poses.

use super::html::{address, cell, note, table};
use crate::report::about::About;
use crate::report::covariance::{correlated, of_rig};
use crate::report::number::to_sigma;
use crate::solve::{Parameter, Solution};
use phasmid_report::plot::{escaped, figures};

/// Correlations above this magnitude are listed.
const CLOSE: f64 = 0.9;
/// Maximum number of correlations listed.
const TOLD: usize = 40;

/// Table of the rig's parameters. Those of the board poses are in `parameters.csv`.
pub(super) fn parameters(solution: &Solution) -> String {
    let rigs: Vec<&Parameter> = solution.parameters.iter().take(of_rig(solution)).collect();
    let rows = rigs.iter().map(|p| {
        vec![
            cell(&p.name),
            cell(&to_sigma(p.value, p.sigma)),
            cell(&figures(p.sigma, 2)),
            cell(p.unit),
        ]
    });
    let mut out = table(&["parameter", "value", "standard deviation", "unit"], rows);
    let pairs = correlated(solution, CLOSE);
    if pairs.is_empty() {
        out.push_str(&note(&format!(
            "No correlation beyond {CLOSE} between these."
        )));
        return out;
    }
    let name = |i: usize| rigs.get(i).map_or("", |p| p.name.as_str());
    let rows = pairs.iter().take(TOLD).map(|pair| {
        let [a, b] = pair.of.map(name);
        vec![cell(a), cell(b), cell(&format!("{:.4}", pair.correlation))]
    });
    out.push_str(&table(&["correlated", "with", "correlation"], rows));
    let more = pairs.len().saturating_sub(TOLD);
    if more > 0 {
        out.push_str(&note(&format!("{more} more pairs are beyond {CLOSE}.")));
    }
    out
}

pub(super) fn poses(solution: &Solution, about: &About) -> String {
    let rows = solution.poses.iter().enumerate().map(|(i, pose)| {
        let name = escaped(&pose.name);
        let name = match about.image(&pose.name) {
            Some(file) => format!("<a href=\"{}\">{name}</a>", address(file)),
            None => name,
        };
        let (c, p) = (&pose.camera_errors, &pose.projector_errors);
        let distance = pose.camera_from_board.translation_mm.length();
        let numbers = [
            c.count.to_string(),
            figures(c.mean_px, 3),
            figures(c.rms_px, 3),
            figures(c.whitened_rms, 3),
            p.count.to_string(),
            figures(p.mean_px, 3),
            figures(p.rms_px, 3),
            figures(p.whitened_rms, 3),
            figures(distance, 4),
            figures(pose.tilt_deg(), 3),
        ];
        let mut row = vec![cell(&(i + 1).to_string()), format!("<td>{name}</td>")];
        row.extend(numbers.iter().map(|n| cell(n)));
        row
    });
    let columns = [
        "",
        "pose",
        "points",
        "mean px",
        "RMS px",
        "whitened",
        "lit",
        "mean px",
        "RMS px",
        "whitened",
        "distance mm",
        "tilt deg",
    ];
    table(&columns, rows)
        + &note(
            "Errors of the camera, then of the projector. The tilt is that of the board against \
             the line of sight to its middle.",
        )
}
