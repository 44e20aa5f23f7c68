//! Size of the region of interest: spheres about the isocentre.

use super::answer::{
    DEVIATIONS, ERRORS, answered, doubted, part, rms, shift_mm, track, turn_deg, worst,
};
use super::effort::Effort;
use super::known::TOLERANCE;
use super::subject::{Body, Subject, everywhere, time_ns};
use crate::clinic::Pods;
use phasmid_core::error::Result;
use phasmid_report::lab::{
    Block, Chart, Check, Context, Figure, Row, Rows, Section, Series, SeriesStyle, Settings, Table,
    Trial,
};
use phasmid_sgrt::{POINTS, Reference, Region, SixDof};

/// Text above the tables.
const WORDS: &str = "A small region is nearly flat: shifts along it and turns about axes in it are \
    poorly determined or undetermined, and the tracker has to report this. The predicted standard \
    deviations contain noise only, not what `phasmid track` adds for light in the skin.";

pub(super) fn trials(settings: &Settings) -> Vec<Trial> {
    let effort = Effort::of(settings);
    vec![Trial::new(
        "region/patient",
        settings.seed,
        move |context| sized(context, effort),
    )]
}

/// Returns the skin within a radius of the isocentre, without the back.
fn within(subject: &Subject, radius_mm: f64) -> Region {
    let [lo, _] = Region::CHEST;
    let all = subject.surface.vertices.iter().zip(0u32..);
    let near = all.filter(|(v, _)| v.length() <= radius_mm && v.z >= lo.z);
    Region::Vertices(near.map(|(_, i)| i).collect())
}

fn sized(context: &Context<'_>, effort: Effort) -> Result<Vec<Row>> {
    let subject = Subject::new(Body::Patient(None))?;
    let [lo, _] = Region::CHEST;
    let front = subject.surface.vertices.iter().filter(|v| v.z >= lo.z);
    let nearest = front.map(|v| v.length()).fold(f64::INFINITY, f64::min);
    let poses: Vec<SixDof> = (0..effort.region_poses)
        .map(|k| match k {
            0 => SixDof::default(),
            _ => everywhere((k as f64 / 2.0).ceil() * if k % 2 == 1 { 1.0 } else { -1.0 }),
        })
        .collect();
    let scene = subject.on_the_way(&poses);
    let mut pods = Pods::new(&scene, context.seed, &|profile| effort.adapt(profile))?;
    let mut scans = Vec::new();
    for k in 0..poses.len() {
        let scan = pods.scan(time_ns(k), true)?;
        scans.push(pods.measured(&scan, POINTS));
    }
    let mut rows = Vec::new();
    for beyond in effort.beyond_mm {
        // Round up to whole millimetres, for the table.
        let radius_mm = (nearest + beyond).ceil();
        let reference = Reference::new(&subject.surface, &within(&subject, radius_mm))?;
        for (measured, truth) in scans.iter().zip(&poses) {
            let fit = track(measured, &reference);
            let row = Row::new()
                .text("subject", "patient")
                .number("by", radius_mm)
                .number("area_cm2", reference.area_mm2() / 100.0);
            rows.push(answered(row, None, &fit, truth));
        }
    }
    Ok(rows)
}

/// Groups rows by radius, in ascending order.
fn radii(rows: &Rows) -> Vec<(f64, Vec<&Row>)> {
    let mut found: Vec<(f64, Vec<&Row>)> = Vec::new();
    for row in part(rows, "region") {
        let radius = row.value("by");
        match found.last_mut() {
            Some((last, all)) if *last == radius => all.push(row),
            _ => found.push((radius, vec![row])),
        }
    }
    found
}

/// Returns the RMS of the errors and of their predicted standard deviations over three directions
/// (length of the vector).
fn both(rows: &[&Row], first: usize) -> [f64; 2] {
    [ERRORS, DEVIATIONS].map(|columns| {
        let all = rows.iter();
        let all = all.flat_map(|row| (0..3).map(move |k| row.value(columns[first + k])));
        rms(all.filter(|v| v.is_finite())) * 3f64.sqrt()
    })
}

pub(super) fn section(rows: &Rows) -> Section {
    let mut blocks = vec![Block::Words(WORDS.to_owned())];
    if !radii(rows).is_empty() {
        blocks.extend([
            Block::Table(table(rows)),
            Block::Figure(figure(rows)),
            Block::Checks(checks(rows)),
        ]);
    }
    Section::new("Size of the region of interest", blocks)
}

fn table(rows: &Rows) -> Table {
    let mut table = Table::new(
        "acceptance-region",
        "The patient's skin within spheres about the isocentre, with the couch displaced in all \
         six directions: RMS error of the position (mm) and of the angles (degrees; both as \
         lengths of vectors), and the standard deviations that the tracker predicts. A motion that \
         it reports as undetermined has a predicted standard deviation equal to its range, 50 mm.",
        &[
            "radius in mm",
            "area in cm2",
            "position",
            "predicted",
            "angles",
            "predicted",
            "warnings",
        ],
    );
    for (radius, all) in radii(rows) {
        let [place, place_sd] = both(&all, 0);
        let [angle, angle_sd] = both(&all, 3);
        let count = all.len();
        table.row([
            format!("{radius}"),
            format!("{:.0}", all[0].value("area_cm2")),
            format!("{place:.3}"),
            format!("{place_sd:.3}"),
            format!("{angle:.4}"),
            format!("{angle_sd:.4}"),
            format!("{} of {count}", doubted(all.into_iter())),
        ]);
    }
    table
}

fn figure(rows: &Rows) -> Figure {
    let radii = radii(rows);
    let series = ["found", "predicted"].map(|name| {
        let points = radii.iter().map(|(_, all)| {
            let [found, predicted] = both(all, 0);
            let y = if name == "found" { found } else { predicted };
            (all[0].value("area_cm2"), y)
        });
        Series::new(name, SeriesStyle::Both, points)
    });
    let chart = Chart {
        heading: "Error of the position".to_owned(),
        x: "area of the region (cm2)".to_owned(),
        y: "RMS error (mm)".to_owned(),
        log: [true, true],
        series: series.into(),
    };
    chart.figure(
        "acceptance-region",
        "RMS error of the tracked position against the area of the region, and the standard \
                  deviation that the tracker predicts.",
    )
}

/// Checks that each result, whatever the size of the region, is accurate or has a warning.
fn checks(rows: &Rows) -> Vec<Check> {
    let silent = part(rows, "region").filter(|row| row.get("warnings").is_empty());
    vec![
        Check::at_most(
            "worst position error without a warning, in mm",
            worst(silent.clone().map(shift_mm).chain([0.0])),
            TOLERANCE[0],
        ),
        Check::at_most(
            "worst angle error without a warning, in degrees",
            worst(silent.map(turn_deg).chain([0.0])),
            TOLERANCE[1],
        ),
    ]
}
