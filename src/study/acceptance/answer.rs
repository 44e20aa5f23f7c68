//! The rigid tracker's result for a scan, compared with the couch's true displacement.

use glam::DVec3;
use phasmid_report::lab::{Row, Rows};
use phasmid_sgrt::{
    Freedom, Lost, Measured, Reference, RigidFit, RigidOptions, SixDof, Start, Warning, six,
    track_rigid,
};

/// Columns of the six errors, measured minus true, in the order of [`six::NAMES`].
pub(super) const ERRORS: [&str; 6] = [
    "error_lat_mm",
    "error_lng_mm",
    "error_vrt_mm",
    "error_pitch_deg",
    "error_roll_deg",
    "error_yaw_deg",
];
/// Columns of the standard deviations that the tracker predicts for these errors.
pub(super) const DEVIATIONS: [&str; 6] = [
    "sd_lat_mm",
    "sd_lng_mm",
    "sd_vrt_mm",
    "sd_pitch_deg",
    "sd_roll_deg",
    "sd_yaw_deg",
];

/// Tracks a scan. The tracker's search starts at the planned pose, as it does after a patient's set-up.
pub(super) fn track(measured: &Measured, reference: &Reference) -> Result<RigidFit, Lost> {
    track_rigid(
        measured,
        reference,
        &Start::SET_UP,
        &RigidOptions::default(),
    )
}

/// Returns the pose of `fit` relative to the pose of an earlier scan, `first`. This is the result
/// that the tracker would give if its reference surface were the scan `first`.
pub(super) fn since(fit: &RigidFit, first: &RigidFit) -> SixDof {
    SixDof::of(&(fit.room_from_reference * first.room_from_reference.inverse()))
}

/// Adds a tracker's result to a row. The row gets the errors of `found`, or of the fitted pose if
/// `found` is `None`. If tracking failed, the row has only a warning.
pub(super) fn answered(
    row: Row,
    found: Option<SixDof>,
    fit: &Result<RigidFit, Lost>,
    truth: &SixDof,
) -> Row {
    let fit = match fit {
        Ok(fit) => fit,
        Err(lost) => return row.text("warnings", &lost.to_string()),
    };
    let found = found.unwrap_or(fit.six).to_array();
    let (truth, deviations) = (truth.to_array(), fit.deviations());
    let mut row = row;
    for k in 0..6 {
        row = row
            .number(ERRORS[k], found[k] - truth[k])
            .number(DEVIATIONS[k], deviations[k]);
    }
    let words: Vec<String> = fit.warnings.iter().map(ToString::to_string).collect();
    row.number("points", fit.points as f64)
        .number("coverage", fit.coverage)
        .number("rms_mm", fit.rms_mm)
        .text("free", &undetermined(fit).join(" "))
        .text("warnings", &words.join("; "))
}

/// Returns the names of the undetermined motions of a result. A motion along or about an axis of the
/// room is named as in [`six::NAMES`].
fn undetermined(fit: &RigidFit) -> Vec<String> {
    let all = fit.warnings.iter().filter_map(|warning| match warning {
        Warning::Undetermined { free, .. } => Some(free),
        _ => None,
    });
    all.flatten().map(name).collect()
}

fn name(free: &Freedom) -> String {
    let (first, axis) = match free {
        Freedom::Shift { along } => (0, *along),
        Freedom::Turn { about, .. } => (3, *about),
    };
    let k = axis.abs().max_position();
    // The motion is within 18 degrees of an axis of the room.
    match axis[k].abs() > 0.95 {
        true => six::NAMES[first + k].to_owned(),
        false => free.to_string(),
    }
}

/// Returns the position error of a row in millimetres; NaN if tracking failed.
pub(super) fn shift_mm(row: &Row) -> f64 {
    let [x, y, z] = [0, 1, 2].map(|k| row.value(ERRORS[k]));
    DVec3::new(x, y, z).length()
}

/// Returns the largest angle error of a row in degrees; NaN if tracking failed.
pub(super) fn turn_deg(row: &Row) -> f64 {
    worst([3, 4, 5].map(|k| row.value(ERRORS[k]).abs()))
}

/// Returns the largest value; NaN without values or if a value is NaN.
pub(super) fn worst(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values = values.into_iter();
    let first = values.next().unwrap_or(f64::NAN);
    values.fold(first, |worst, value| {
        if value.is_nan() || worst.is_nan() {
            f64::NAN
        } else {
            worst.max(value)
        }
    })
}

/// Returns the root mean square; NaN without values.
pub(super) fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values {
        sum += value * value;
        count += 1.0;
    }
    f64::sqrt(sum / count)
}

/// Returns the rows of one part of the study, selected by the start of their trials' names.
pub(super) fn part<'a>(rows: &'a Rows, name: &'a str) -> impl Iterator<Item = &'a Row> + Clone {
    rows.all.iter().filter(move |row| {
        let trial = row.get("trial").strip_prefix(name);
        trial.is_some_and(|rest| rest.starts_with('/'))
    })
}

/// Counts the rows for which tracking failed or gave a warning.
pub(super) fn doubted<'a>(rows: impl Iterator<Item = &'a Row>) -> usize {
    rows.filter(|row| !row.get("warnings").is_empty()).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_hides_a_scan_without_an_answer() {
        assert_eq!(worst([1.0, 3.0, 2.0]), 3.0);
        assert!(worst([1.0, f64::NAN, 2.0]).is_nan());
        assert!(worst([f64::NAN, 2.0]).is_nan() && worst([]).is_nan());
        assert_eq!(rms([3.0, -4.0]), 12.5f64.sqrt());
        let lost = Row::new();
        assert!(shift_mm(&lost).is_nan() && turn_deg(&lost).is_nan());
        let mut row = Row::new();
        for (k, name) in ERRORS.iter().enumerate() {
            row = row.number(name, [2.0, -2.0, 1.0, 0.1, -0.3, 0.2][k]);
        }
        assert_eq!((shift_mm(&row), turn_deg(&row)), (3.0, 0.3));
        assert!(turn_deg(&row.number(ERRORS[4], f64::NAN)).is_nan());
    }
}
