//! One patient: scans at moments spread over the breathing, and the tracker's result for each.

use super::inputs::{Input, SIZE_PX, Scanners, Skin};
use crate::clinic::{InRoom, Moment};
use crate::draws::Draws;
use phasmid_core::error::Result;
use phasmid_geometry::Pose;
use phasmid_measure::{OVERLAP_COLUMNS, overlap};
use phasmid_report::lab::{Context, Row};
use phasmid_sgrt::{FitOptions, MotionState, MotionTracker, Planned, Region};

/// Start of treatment in seconds of device time, after set-up and drift.
const BEGIN_S: f64 = 60.0;
/// Breaths between two moments: not an integer, so that moments see different parts of a breath.
const BREATHS: f64 = 3.17;

/// Tracks a patient; returns a row for each moment and each input.
///
/// # Errors
/// Returns an error if there is no such patient, or on I/O failure.
pub(super) fn follow(context: &Context<'_>, name: &str, moments: usize) -> Result<Vec<Row>> {
    let scratch = context.folder.place(&format!("planning-{name}"))?;
    let room = InRoom::new(name, &Region::chest(), &scratch)?;
    let planned = &room.planned;
    let options = FitOptions::by_hand();
    let tracker = MotionTracker::new(&planned.reference, &planned.model, Pose::IDENTITY, &options)?;
    let mut scanners = Scanners::new(&room, context.seed, SIZE_PX)?;
    let duration_ns = scanners.duration_ns();
    let apart_s = room.phantom.patient().breathing.period_s * BREATHS;
    let mut rows = Vec::new();
    for k in 0..moments {
        let start_ns = ((BEGIN_S + k as f64 * apart_s) * 1e9) as u64;
        let moment = room.at(start_ns + duration_ns / 2);
        let late = room.at(start_ns + duration_ns);
        let draws = Draws::new(context.seed, k as u32);
        let skins = scanners.skins(start_ns, (&room, &moment), &draws)?;
        for skin in skins {
            let row = Row::new()
                .text("patient", name)
                .number("time_s", start_ns as f64 * 1e-9)
                .text("input", skin.input.name());
            rows.push(judge(row, &skin, (&tracker, planned), [&moment, &late])?);
        }
    }
    Ok(rows)
}

/// Compares the tracker's result for a skin with the truth at the middle and at the end of the scan.
fn judge(
    row: Row,
    skin: &Skin,
    (tracker, planned): (&MotionTracker<'_>, &Planned),
    [moment, late]: [&Moment; 2],
) -> Result<Row> {
    let mut row = row.number("points", skin.measured.len() as f64);
    if let Some(against) = &skin.against {
        row = row
            .number("skin_bias_mm", against.bias_mm)
            .number("skin_rmse_mm", against.rmse_mm)
            .number("skin_gross", against.gross)
            .number("skin_beyond_5_sigma", against.beyond);
    }
    let moved = (moment.tumour_mm - planned.tumour_mm()).length();
    row = row.number("moved_mm", moved);
    let fit = match tracker.fit(&skin.measured, &MotionState::mean(&planned.model)) {
        Ok(fit) => fit,
        Err(lost) => return Ok(row.text("warnings", &lost.to_string())),
    };
    let error = fit.tumour_mm - moment.tumour_mm;
    let shared = overlap(&fit.tumour(&planned.model), &moment.tumour, OVERLAP_COLUMNS)?;
    let variance = fit.total_covariance(planned.tumour_mm());
    let variance = variance.x_axis.x + variance.y_axis.y + variance.z_axis.z;
    let warnings: Vec<String> = fit.warnings.iter().map(ToString::to_string).collect();
    if skin.input == Input::Scanned {
        row = row.number("late_mm", (fit.tumour_mm - late.tumour_mm).length());
    }
    Ok(row
        .number("tpe_mm", error.length())
        .number("dice", shared.dice)
        .number("error_x_mm", error.x)
        .number("error_y_mm", error.y)
        .number("error_z_mm", error.z)
        .number("deviation_mm", variance.max(0.0).sqrt())
        .number("skin_coverage", fit.coverage)
        .text("warnings", &warnings.join("; ")))
}
