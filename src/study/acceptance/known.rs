//! Known shifts and turns of the couch, and the tracker's results for them.

use super::answer::{
    DEVIATIONS, ERRORS, answered, doubted, part, rms, shift_mm, since, track, turn_deg, worst,
};
use super::effort::Effort;
use super::subject::{Body, Subject, time_ns};
use crate::clinic::Pods;
use phasmid_core::error::Result;
use phasmid_report::lab::{
    Block, Chart, Check, Context, Figure, Row, Rows, Section, Series, SeriesStyle, Settings, Table,
    Trial,
};
use phasmid_sgrt::{POINTS, SixDof, six};

/// Text above the tables.
const WORDS: &str = "The torso is opaque, as phantoms are. The patient holds the breath at the \
    reference phase. Light that enters the skin and leaves it elsewhere shifts the measured \
    surface by some tenths of a millimetre, so results relative to the planned surface have an \
    error that is the same in all scans. It cancels relative to a surface that the scanner has \
    captured itself.";

/// Maximum error for a still torso: position in millimetres, angles in degrees.
pub(super) const BAR: [f64; 2] = [0.1, 0.05];
/// Tolerances of a clinic, in the units of [`BAR`].
pub(super) const TOLERANCE: [f64; 2] = [1.0, 0.5];
const BODIES: [Body; 2] = [Body::Torso, Body::Patient(None)];
/// References of the results: the planned surface, and the tracker's own result for the first scan.
const AGAINST: [&str; 2] = ["planned surface", "first scan"];

pub(super) fn trials(settings: &Settings) -> Vec<Trial> {
    let effort = Effort::of(settings);
    let one = |body: Body| {
        let key = format!("known/{}", body.name());
        Trial::new(key, settings.seed, move |context| {
            shifted(context, body, effort)
        })
    };
    BODIES.map(one).into()
}

/// Returns a displacement by `by` along or about one of the six directions.
fn along(k: usize, by: f64) -> SixDof {
    let mut six = SixDof::default();
    match k {
        0..3 => six.translation_mm[k] = by,
        _ => six.rotation_deg[k % 3] = by,
    }
    six
}

/// Returns the zero displacement, then each step in each direction.
fn displacements(effort: Effort) -> Vec<(usize, f64)> {
    let mut all = vec![(0, 0.0)];
    for k in 0..6 {
        let steps = if k < 3 {
            effort.shifts_mm
        } else {
            effort.turns_deg
        };
        for &by in steps {
            let here = if k % 2 == 0 { by } else { -by };
            all.push((k, here));
            if effort.both_ways {
                all.push((k, -here));
            }
        }
    }
    all
}

fn shifted(context: &Context<'_>, body: Body, effort: Effort) -> Result<Vec<Row>> {
    let subject = Subject::new(body)?;
    let reference = subject.reference()?;
    let displacements = displacements(effort);
    let poses: Vec<SixDof> = displacements.iter().map(|&(k, by)| along(k, by)).collect();
    let scene = subject.on_the_way(&poses);
    let mut pods = Pods::new(&scene, context.seed, &|profile| effort.adapt(profile))?;
    let mut rows = Vec::new();
    let mut first = None;
    for (i, (truth, (k, by))) in poses.iter().zip(displacements).enumerate() {
        let scan = pods.scan(time_ns(i), true)?;
        let fit = track(&pods.measured(&scan, POINTS), &reference);
        let row = |against: &str| {
            Row::new()
                .text("subject", body.name())
                .text("case", against)
                .text("motion", six::NAMES[k])
                .number("by", by)
        };
        rows.push(answered(row(AGAINST[0]), None, &fit, truth));
        let Ok(found) = &fit else { continue };
        match &first {
            None => first = Some(found.clone()),
            Some(first) => {
                let moved = Some(since(found, first));
                rows.push(answered(row(AGAINST[1]), moved, &fit, truth));
            }
        }
    }
    Ok(rows)
}

fn of<'a>(
    rows: &'a Rows,
    body: &'a str,
    against: &'a str,
) -> impl Iterator<Item = &'a Row> + Clone {
    let all = part(rows, "known");
    all.filter(move |row| row.get("subject") == body && row.get("case") == against)
}

pub(super) fn section(rows: &Rows) -> Section {
    let mut table = Table::new(
        "acceptance-known",
        "The couch is displaced by known amounts along or about one of the six directions at a \
         time. Worst and RMS error over all scans, of the position (length of the error vector, \
         mm) and of the angles (worst: largest of the three, degrees; RMS: of all three), relative \
         to the planned surface and to the tracker's result for the first, undisplaced scan.",
        &[
            "subject, reference",
            "scans",
            "position: worst",
            "RMS",
            "angles: worst",
            "RMS",
            "warnings",
        ],
    );
    for body in BODIES.map(Body::name) {
        for against in AGAINST {
            let all = of(rows, body, against);
            let count = all.clone().count();
            if count == 0 {
                continue;
            }
            let angles = all
                .clone()
                .flat_map(|row| [3, 4, 5].map(|k| row.value(ERRORS[k])));
            table.row([
                format!("{body}, {against}"),
                count.to_string(),
                format!("{:.3}", worst(all.clone().map(shift_mm))),
                format!("{:.3}", rms(all.clone().map(shift_mm))),
                format!("{:.4}", worst(all.clone().map(turn_deg))),
                format!("{:.4}", rms(angles)),
                doubted(all).to_string(),
            ]);
        }
    }
    Section::new(
        "Known displacements of the couch",
        vec![
            Block::Words(WORDS.to_owned()),
            Block::Table(table),
            Block::Table(directions(rows)),
            Block::Figure(figure(rows)),
            Block::Checks(checks(rows)),
        ],
    )
}

/// Tabulates the six directions separately, with the tracker's own standard deviations.
fn directions(rows: &Rows) -> Table {
    let mut table = Table::new(
        "acceptance-directions",
        "The same scans relative to the planned surface, for each direction: mean error (common to \
         all scans), standard deviation of the errors about it, and the standard deviation that \
         the tracker predicts (RMS over the scans), in mm and degrees.",
        &["subject, direction", "mean error", "deviation", "predicted"],
    );
    for body in BODIES.map(Body::name) {
        let all: Vec<&Row> = of(rows, body, AGAINST[0]).collect();
        if all.is_empty() {
            continue;
        }
        for k in 0..6 {
            let errors = all.iter().map(|row| row.value(ERRORS[k]));
            let mean = errors.clone().sum::<f64>() / all.len() as f64;
            let unit = if k < 3 { "mm" } else { "deg" };
            table.row([
                format!("{body}, {} ({unit})", six::NAMES[k]),
                format!("{mean:+.4}"),
                format!("{:.4}", rms(errors.map(|error| error - mean))),
                format!("{:.4}", rms(all.iter().map(|row| row.value(DEVIATIONS[k])))),
            ]);
        }
    }
    table
}

/// Plots the error along the direction of each shift.
fn figure(rows: &Rows) -> Figure {
    let bodies = BODIES.map(Body::name);
    let series = bodies.iter().flat_map(|body| {
        (0..3).map(move |k| {
            let all = of(rows, body, AGAINST[0]);
            let all = all.filter(|row| row.get("motion") == six::NAMES[k]);
            let points = all.map(|row| (row.value("by"), row.value(ERRORS[k])));
            let mut points: Vec<(f64, f64)> = points.collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            Series::new(
                &format!("{body}, {}", six::NAMES[k]),
                SeriesStyle::Both,
                points,
            )
        })
    });
    let chart = Chart {
        heading: "Error of a shift".to_owned(),
        x: "shift of the couch (mm)".to_owned(),
        y: "error along it (mm)".to_owned(),
        log: [false, false],
        series: series.collect(),
    };
    chart.figure(
        "acceptance-known",
        "Measured minus true shift, along the direction of the shift.",
    )
}

fn checks(rows: &Rows) -> Vec<Check> {
    let mut checks = Vec::new();
    for (body, bar) in [("torso", BAR), ("patient", TOLERANCE)] {
        let all = of(rows, body, AGAINST[0]);
        if all.clone().next().is_none() {
            continue;
        }
        checks.extend([
            Check::at_most(
                format!("worst error of the {body}'s place, in mm"),
                worst(all.clone().map(shift_mm)),
                bar[0],
            ),
            Check::at_most(
                format!("worst error of the {body}'s angles, in degrees"),
                worst(all.clone().map(turn_deg)),
                bar[1],
            ),
            Check::at_most(
                format!(
                    "results with a warning for the {body}, whose shape determines all motions"
                ),
                doubted(all) as f64,
                0.0,
            ),
        ]);
    }
    checks
}

/// Returns the worst errors of the torso's position and angles.
pub(super) fn worst_of_torso(rows: &Rows, against: usize) -> [f64; 2] {
    let all = of(rows, "torso", AGAINST[against]);
    [worst(all.clone().map(shift_mm)), worst(all.map(turn_deg))]
}
