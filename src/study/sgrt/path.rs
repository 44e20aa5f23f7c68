//! One patient during a breath, scan by scan: the true and the tracked position of the tumour.

use super::inputs::SIZE_PX;
use super::paired::of;
use crate::clinic::{InRoom, Pods, binned};
use glam::DVec3;
use phasmid_core::error::Result;
use phasmid_geometry::Pose;
use phasmid_report::lab::{Block, Chart, Context, Row, Rows, Series, SeriesStyle, Settings, Trial};
use phasmid_sgrt::{FitOptions, MotionState, MotionTracker, POINTS, Region};

/// Device time of the first scan in seconds.
const BEGIN_S: f64 = 60.0;
/// Number of points of the true path that are drawn between two scans.
const BETWEEN: usize = 8;
/// The room's axes as clinics name them.
const AXES: [(&str, &str); 3] = [
    ("to the right (LAT)", "x_mm"),
    ("to the gantry (LNG)", "y_mm"),
    ("up (VRT)", "z_mm"),
];

/// Returns the trial, with `scans` scans during the breath.
pub(super) fn trial(settings: &Settings, patient: &'static str, scans: usize) -> Trial {
    Trial::new("path", settings.seed, move |context| {
        follow(context, patient, scans)
    })
}

fn follow(context: &Context<'_>, patient: &str, scans: usize) -> Result<Vec<Row>> {
    let scratch = context.folder.place("planning-path")?;
    let room = InRoom::new(patient, &Region::chest(), &scratch)?;
    let planned = &room.planned;
    let options = FitOptions::by_hand();
    let tracker = MotionTracker::new(&planned.reference, &planned.model, Pose::IDENTITY, &options)?;
    let mut pods = Pods::new(&room.scene, context.seed, &|profile| {
        binned(profile, SIZE_PX)
    })?;
    let step_s = room.phantom.patient().breathing.period_s / scans as f64;
    let row = |input: &str, time_s: f64, place: DVec3| {
        let row = Row::new().text("patient", patient).text("input", input);
        let row = row.number("time_s", time_s);
        let axes = AXES.iter().zip(place.to_array());
        axes.fold(row, |row, ((_, column), v)| row.number(column, v))
    };
    let mut rows = Vec::new();
    for i in 0..=scans * BETWEEN {
        let time_s = BEGIN_S + i as f64 * step_s / BETWEEN as f64;
        rows.push(row("way", time_s, room.at((time_s * 1e9) as u64).tumour_mm));
    }
    let mut state = MotionState::mean(&planned.model);
    for i in 0..=scans {
        let start_ns = ((BEGIN_S + i as f64 * step_s) * 1e9) as u64;
        let scan = pods.scan(start_ns, false)?;
        let middle_s = (start_ns + pods.duration_ns() / 2) as f64 * 1e-9;
        if let Ok(fit) = tracker.fit(&pods.measured(&scan, POINTS), &state) {
            rows.push(row("followed", middle_s, fit.tumour_mm));
            state = fit.state;
        }
    }
    Ok(rows)
}

/// Plots the true and the tracked path over time.
pub(super) fn block(rows: &Rows) -> Block {
    let mut series = Vec::new();
    for (name, column) in AXES {
        for (input, word, style) in [
            ("way", "true", SeriesStyle::Line),
            ("followed", "followed", SeriesStyle::Dots),
        ] {
            let points = of(rows, input, None);
            let points = points.map(|row| (row.value("time_s") - BEGIN_S, row.value(column)));
            let name = format!("{name}, {word}");
            let mut one = Series::new(&name, style, points.collect::<Vec<_>>());
            one.paired = input == "followed";
            series.push(one);
        }
    }
    let chart = Chart {
        heading: "Position of the tumour during a breath".to_owned(),
        x: "time (s)".to_owned(),
        y: "position of the tumour relative to the isocentre (mm)".to_owned(),
        log: [false, false],
        series,
    };
    Block::Figure(chart.figure(
        "sgrt-path",
        "One patient during a breath: true position of the \
                  tumour (lines), and the tracked position from each scan of the three pods \
                  (dots), plotted at the middle of the scan.",
    ))
}
