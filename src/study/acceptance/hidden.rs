//! Pods that do not see the patient, because the linac's head hides them or they are left out.

use super::answer::{ERRORS, answered, part, rms, shift_mm, track, turn_deg, worst};
use super::effort::Effort;
use super::known::TOLERANCE;
use super::subject::{Body, Subject};
use crate::clinic::Pods;
use phasmid_core::error::Result;
use phasmid_report::lab::{Block, Check, Context, Row, Rows, Section, Settings, Table, Trial};
use phasmid_sgrt::{POINTS, Region, SixDof};

/// Text above the tables.
const WORDS: &str = "The head of the linac rotates about the couch's axis; under the couch, at 180 \
    degrees, it hides nothing. It never hides the isocentre from the pod over the foot end. At \
    some angles it hides only the far side of the chest from a pod.";

/// Gantry angle in degrees at which the head is under the couch and hides nothing.
const AWAY_DEG: f64 = 180.0;
/// Names of the pods, and the columns of their numbers of points, in the order in which the pods scan.
const PODS: [(&str, &str); 3] = [
    ("left", "points_left"),
    ("right", "points_right"),
    ("foot", "points_foot"),
];
/// A pod counts as hidden if it has at most this fraction of the points of its unobstructed scan.
const HIDDEN: f64 = 0.25;

pub(super) fn trials(settings: &Settings) -> Vec<Trial> {
    let effort = Effort::of(settings);
    let gantry = std::iter::once(&AWAY_DEG).chain(effort.gantry_deg);
    let one = |&degrees: &f64| {
        Trial::new(format!("hidden/{degrees}"), settings.seed, move |context| {
            at(context, degrees, effort)
        })
    };
    gantry.map(one).collect()
}

/// Scans with the head at an angle. At [`AWAY_DEG`], also evaluates the scan without each pod in turn.
fn at(context: &Context<'_>, gantry_deg: f64, effort: Effort) -> Result<Vec<Row>> {
    let subject = Subject::under_head(Body::Patient(None), gantry_deg)?;
    let reference = subject.reference()?;
    let mut pods = Pods::new(&subject.scene, context.seed, &|profile| {
        effort.adapt(profile)
    })?;
    let scan = pods.scan(0, false)?;
    let [lo, hi] = Region::CHEST;
    // Exclude the head, which is above the chest.
    let hi = hi.with_z(hi.x);
    let mut seen = Vec::new();
    for (pod, decoded) in pods.all.iter().zip(&scan) {
        let points = pod.points(decoded);
        let inside = points
            .iter()
            .filter(|p| p.cmpge(lo).all() && p.cmple(hi).all());
        seen.push(inside.count() as f64);
    }
    let leave = match gantry_deg == AWAY_DEG {
        true => vec![None, Some(0), Some(1), Some(2)],
        false => vec![None],
    };
    let rows = leave.into_iter().map(|without: Option<usize>| {
        let fit = track(&pods.measured_without(&scan, POINTS, without), &reference);
        let mut row = Row::new()
            .text("subject", "patient")
            .text("case", without.map_or("head", |i| PODS[i].0))
            .number("gantry_deg", gantry_deg);
        for (i, (_, column)) in PODS.iter().enumerate() {
            let points = if Some(i) == without { 0.0 } else { seen[i] };
            row = row.number(column, points);
        }
        answered(row, None, &fit, &SixDof::default())
    });
    Ok(rows.collect())
}

/// Returns the row with all pods visible, and the other rows.
fn all(rows: &Rows) -> Option<(&Row, Vec<&Row>)> {
    let (whole, fewer): (Vec<&Row>, Vec<&Row>) = part(rows, "hidden")
        .partition(|row| row.get("case") == "head" && row.value("gantry_deg") == AWAY_DEG);
    Some((*whole.first()?, fewer))
}

/// Returns the change of the position (mm) and the largest change of an angle (degrees) from the result
/// `whole` of all pods.
fn changed(row: &Row, whole: &Row) -> [f64; 2] {
    let off: [f64; 6] = std::array::from_fn(|k| row.value(ERRORS[k]) - whole.value(ERRORS[k]));
    let place = rms(off[..3].iter().copied()) * 3f64.sqrt();
    [place, worst(off[3..].iter().map(|angle| angle.abs()))]
}

/// Returns the number of a pod's points as a fraction of its number in the scan `whole` of all pods.
fn left(row: &Row, whole: &Row, pod: usize) -> f64 {
    row.value(PODS[pod].1) / whole.value(PODS[pod].1)
}

/// Returns the largest change of the position, in millimetres, when a pod is hidden or left out.
pub(super) fn largest_mm(rows: &Rows) -> f64 {
    let Some((whole, fewer)) = all(rows) else {
        return f64::NAN;
    };
    let hidden = |row: &&&Row| (0..3).any(|pod| left(row, whole, pod) <= HIDDEN);
    worst(
        fewer
            .iter()
            .filter(hidden)
            .map(|row| changed(row, whole)[0]),
    )
}

pub(super) fn section(rows: &Rows) -> Section {
    let mut blocks = vec![Block::Words(WORDS.to_owned())];
    if let Some((whole, fewer)) = all(rows) {
        blocks.push(Block::Table(table(whole, &fewer)));
        blocks.push(Block::Checks(checks(whole, &fewer)));
    }
    Section::new("Hidden pods", blocks)
}

fn table(whole: &Row, fewer: &[&Row]) -> Table {
    let mut table = Table::new(
        "acceptance-hidden",
        "A still patient with the head of the linac at a gantry angle, or with one pod left out: \
         share of its points on the chest that each pod retains, share of the region that is \
         measured, and change of the position (mm) and of the angles (largest of the three, \
         degrees) relative to the result of all pods.",
        &[
            "", "left", "right", "foot", "measured", "position", "angles", "warnings",
        ],
    );
    for row in std::iter::once(&whole).chain(fewer) {
        let name = match row.get("case") {
            "head" => format!("gantry at {} degrees", row.get("gantry_deg")),
            pod => format!("without the {pod} pod"),
        };
        let [place, angle] = changed(row, whole);
        let share = |pod| format!("{:.0} %", 100.0 * left(row, whole, pod));
        let warnings = row.get("warnings");
        table.row([
            name,
            share(0),
            share(1),
            share(2),
            format!("{:.0} %", 100.0 * row.value("coverage")),
            format!("{place:.3}"),
            format!("{angle:.4}"),
            if warnings.is_empty() {
                "none"
            } else {
                warnings
            }
            .to_owned(),
        ]);
    }
    table
}

/// Checks that the head hides the expected pods, and that results without them are accurate or have a
/// warning.
fn checks(whole: &Row, fewer: &[&Row]) -> Vec<Check> {
    let silent = fewer.iter().filter(|row| row.get("warnings").is_empty());
    let at = |degrees: f64, pod: usize| {
        let rows = fewer
            .iter()
            .filter(|row| row.value("gantry_deg") == degrees);
        let head = rows.filter(|row| row.get("case") == "head");
        worst(head.map(|row| left(row, whole, pod)))
    };
    vec![
        Check::at_most(
            "share of the right pod's points that remain at 40 degrees",
            at(40.0, 1),
            HIDDEN,
        ),
        Check::at_most(
            "share of the left pod's points that remain at 320 degrees",
            at(320.0, 0),
            HIDDEN,
        ),
        Check::at_most(
            "worst position error without a warning, in mm",
            worst(silent.clone().map(|row| shift_mm(row)).chain([0.0])),
            TOLERANCE[0],
        ),
        Check::at_most(
            "worst angle error without a warning, in degrees",
            worst(silent.map(|row| turn_deg(row)).chain([0.0])),
            TOLERANCE[1],
        ),
    ]
}
