//! Key figures of a calibration, for the screen and for `summary.json`.

use super::about::About;
use super::covariance::of_rig;
use super::number::{shown, to_sigma};
use crate::rig::Calibration;
use crate::solve::{Errors, Solution};
use phasmid_geometry::Board;
use phasmid_report::plot::figures;
use serde::Serialize;
use std::fmt;

/// Key figures of a calibration, as stored in `summary.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// `phasmid calibrate` and its version; marks a folder as a calibration.
    pub made_by: String,
    /// Other entries of the report's head, as name and value.
    pub remarks: Vec<(String, String)>,
    /// The calibration board.
    pub board: Board,
    /// Number of poses used.
    pub poses: usize,
    /// Number of points in these poses with weight 0 for the camera, the projector or both.
    pub outliers: usize,
    /// Reprojection errors of the camera points, in camera pixels.
    pub camera: Figures,
    /// Reprojection errors of the projector coordinates, in projector pixels.
    pub projector: Figures,
    /// Estimated distortion coefficients of the camera.
    pub camera_coefficients: Vec<&'static str>,
    /// Estimated distortion coefficients of the projector.
    pub projector_coefficients: Vec<&'static str>,
    /// Sum of squared whitened residuals over the degrees of freedom; about 1 if the covariances of
    /// the points are right.
    pub variance_factor: f64,
    /// Factors by which the covariances of camera points and of projector coordinates were
    /// multiplied.
    pub inflation: [f64; 2],
    /// Number of scalar observations minus number of parameters.
    pub degrees_of_freedom: usize,
    /// Condition number of the correlation matrix of the rig's parameters.
    pub condition: f64,
    /// Distance from the camera's pupil to the projector's, in millimetres.
    pub baseline_mm: f64,
    /// Number of solver runs.
    pub rounds: usize,
    /// Largest distance from a dot's centroid to the image of its centre, in pixels.
    pub largest_bias_px: f64,
    /// Largest distance that a corrected point would move in one more solver run, in pixels.
    pub last_move_px: f64,
    /// Parameters of the two lenses and of the projector's pose.
    pub parameters: Vec<SummaryParameter>,
    /// Poses that were excluded.
    pub left_out: Vec<LeftOutPose>,
    /// Warnings about the reliability of the result.
    pub warnings: Vec<String>,
}

/// Reprojection error statistics of camera points or projector coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Figures {
    /// Number of points.
    pub points: usize,
    /// Mean reprojection error in pixels.
    pub mean_px: f64,
    /// RMS reprojection error in pixels.
    pub rms_px: f64,
    /// Maximum reprojection error in pixels.
    pub max_px: f64,
    /// RMS of the components of the whitened residuals; about 1 if the covariances are right.
    pub whitened_rms: f64,
}

/// An estimated parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SummaryParameter {
    /// Name, such as `camera.fx`.
    pub name: String,
    /// `px`, `mm`, `rad` or empty.
    pub unit: &'static str,
    /// Its value.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// A pose that was excluded.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LeftOutPose {
    /// Its name.
    pub name: String,
    /// Reason.
    pub why: String,
}

impl From<&Errors> for Figures {
    fn from(e: &Errors) -> Self {
        Self {
            points: e.count,
            mean_px: e.mean_px,
            rms_px: e.rms_px,
            max_px: e.max_px,
            whitened_rms: e.whitened_rms,
        }
    }
}

const COEFFICIENTS: [&str; 5] = ["k1", "k2", "p1", "p2", "k3"];

fn named(estimated: [bool; 5]) -> Vec<&'static str> {
    let pairs = COEFFICIENTS.into_iter().zip(estimated);
    pairs
        .filter_map(|(name, yes)| yes.then_some(name))
        .collect()
}

impl Summary {
    /// Collects the key figures of a calibration.
    pub fn new(calibration: &Calibration, about: &About) -> Self {
        let solution = &calibration.solution;
        let missed = calibration
            .missed
            .iter()
            .map(|m| (&m.name, m.why.to_string()));
        let unsolved = solution
            .left_out
            .iter()
            .map(|l| (&l.name, l.why.to_string()));
        let left_out = missed.chain(unsolved).map(|(name, why)| LeftOutPose {
            name: name.clone(),
            why,
        });
        let points = solution.poses.iter().flat_map(|pose| &pose.points);
        let outliers = points
            .filter(|p| p.camera_weight <= 0.0 || p.projector.is_some_and(|lit| lit.weight <= 0.0));
        let rig = &solution.rig;
        Self {
            made_by: about.made_by.clone(),
            remarks: about.remarks.clone(),
            board: calibration.board,
            poses: solution.poses.len(),
            outliers: outliers.count(),
            camera: (&solution.camera_errors).into(),
            projector: (&solution.projector_errors).into(),
            camera_coefficients: named(solution.camera_coefficients),
            projector_coefficients: named(solution.projector_coefficients),
            variance_factor: solution.variance_factor,
            inflation: solution.inflation,
            degrees_of_freedom: solution.degrees_of_freedom,
            condition: solution.condition,
            baseline_mm: (rig.projector.center() - rig.camera.center()).length(),
            rounds: calibration.rounds,
            largest_bias_px: calibration.largest_bias_px,
            last_move_px: calibration.last_move_px,
            parameters: parameters(solution),
            left_out: left_out.collect(),
            warnings: calibration.warnings.clone(),
        }
    }

    /// Returns the figures as JSON with a final line break.
    pub fn to_json(&self) -> String {
        let json = serde_json::to_string_pretty(self).expect("numbers and strings");
        format!("{json}\n")
    }
}

fn parameters(solution: &Solution) -> Vec<SummaryParameter> {
    let rigs = solution.parameters.iter().take(of_rig(solution));
    rigs.map(|p| SummaryParameter {
        name: p.name.clone(),
        unit: p.unit,
        value: p.value,
        sigma: p.sigma,
    })
    .collect()
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [columns, rows] = self.board.grid();
        let left_out = self.left_out.len();
        writeln!(
            f,
            "poses: {} used, {left_out} left out; a board of {columns} x {rows} points",
            self.poses
        )?;
        for (name, value) in &self.remarks {
            writeln!(f, "{}: {}", shown(name), shown(value))?;
        }
        writeln!(f)?;
        writeln!(f, "{:<26}{:>14}{:>14}", "", "camera", "projector")?;
        let (c, p) = (&self.camera, &self.projector);
        writeln!(f, "{:<26}{:>14}{:>14}", "points", c.points, p.points)?;
        let mut row = |name: &str, a: f64, b: f64, unit: &str| {
            let cell = |v: f64| format!("{} {unit}", figures(v, 3)).trim_end().to_owned();
            writeln!(f, "{name:<26}{:>14}{:>14}", cell(a), cell(b))
        };
        row("mean reprojection error", c.mean_px, p.mean_px, "px")?;
        row("RMS reprojection error", c.rms_px, p.rms_px, "px")?;
        row("largest", c.max_px, p.max_px, "px")?;
        row("whitened RMS", c.whitened_rms, p.whitened_rms, "")?;
        writeln!(f)?;
        writeln!(
            f,
            "variance factor {} over {} degrees of freedom; outliers: {}",
            figures(self.variance_factor, 4),
            self.degrees_of_freedom,
            self.outliers
        )?;
        writeln!(f)?;
        for p in &self.parameters {
            let (value, sigma) = (to_sigma(p.value, p.sigma), figures(p.sigma, 2));
            let line = format!("{:<26}{value:>14} +- {sigma:<9} {}", shown(&p.name), p.unit);
            writeln!(f, "{}", line.trim_end())?;
        }
        for LeftOutPose { name, why } in &self.left_out {
            writeln!(f, "left out, {}: {}", shown(name), shown(why))?;
        }
        for warning in &self.warnings {
            writeln!(f, "warning: {}", shown(warning))?;
        }
        Ok(())
    }
}
