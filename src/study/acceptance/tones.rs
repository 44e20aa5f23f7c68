//! Skin tones: the same patient of each class of Fitzpatrick's scale.

use super::answer::{answered, part, rms, shift_mm, since, track, turn_deg, worst};
use super::effort::Effort;
use super::known::TOLERANCE;
use super::subject::{Body, Subject, everywhere, time_ns};
use crate::clinic::Pods;
use phasmid_core::error::Result;
use phasmid_report::lab::{Block, Check, Context, Row, Rows, Section, Settings, Table, Trial};
use phasmid_sgrt::{POINTS, SixDof};

/// Text above the tables.
const WORDS: &str = "Dark skin returns less light, which gives more noise and fewer points. Less \
    of the light that enters it comes back out, so the error common to all scans need not be \
    larger.";

pub(super) fn trials(settings: &Settings) -> Vec<Trial> {
    let effort = Effort::of(settings);
    let one = |&class: &u8| {
        Trial::new(format!("tones/{class}"), settings.seed, move |context| {
            toned(context, class, effort)
        })
    };
    effort.tones.iter().map(one).collect()
}

fn toned(context: &Context<'_>, class: u8, effort: Effort) -> Result<Vec<Row>> {
    let subject = Subject::new(Body::Patient(Some(class)))?;
    let reference = subject.reference()?;
    let poses = [SixDof::default(), everywhere(1.0), everywhere(-1.0)];
    let scene = subject.on_the_way(&poses);
    let mut pods = Pods::new(&scene, context.seed, &|profile| effort.adapt(profile))?;
    let mut rows = Vec::new();
    let mut first = None;
    for (k, truth) in poses.iter().enumerate() {
        let scan = pods.scan(time_ns(k), true)?;
        let fit = track(&pods.measured(&scan, POINTS), &reference);
        let row = |case: &str| {
            Row::new()
                .text("subject", "patient")
                .text("case", case)
                .number("by", f64::from(class))
        };
        rows.push(answered(row("planned"), None, &fit, truth));
        let Ok(found) = &fit else { continue };
        match &first {
            None => first = Some(found.clone()),
            Some(first) => {
                rows.push(answered(
                    row("first"),
                    Some(since(found, first)),
                    &fit,
                    truth,
                ));
            }
        }
    }
    Ok(rows)
}

fn of<'a>(rows: &'a Rows, class: u8, case: &'static str) -> impl Iterator<Item = &'a Row> + Clone {
    part(rows, "tones")
        .filter(move |row| row.value("by") == f64::from(class) && row.get("case") == case)
}

/// Returns the worst errors over all tones, in millimetres and degrees; NaN without rows.
pub(super) fn worst_of_all(rows: &Rows) -> [f64; 2] {
    let planned = part(rows, "tones").filter(|row| row.get("case") == "planned");
    [
        worst(planned.clone().map(shift_mm)),
        worst(planned.map(turn_deg)),
    ]
}

pub(super) fn section(rows: &Rows) -> Section {
    let mut table = Table::new(
        "acceptance-tones",
        "The same patient with skin of the classes of Fitzpatrick's scale, with the couch \
         displaced in all six directions, both ways: share of the region that is measured, RMS \
         distance of the points from the tracked surface (mm), worst error of the position (mm) \
         and of the angles (degrees) relative to the planned surface, and of the position relative \
         to the first scan.",
        &[
            "class",
            "measured",
            "residuals",
            "position",
            "angles",
            "position since the first scan",
        ],
    );
    for class in 1..=6 {
        let all = of(rows, class, "planned");
        let count = all.clone().count() as f64;
        if count == 0.0 {
            continue;
        }
        let coverage: f64 = all.clone().map(|row| row.value("coverage")).sum();
        table.row([
            class.to_string(),
            format!("{:.1} %", 100.0 * coverage / count),
            format!("{:.3}", rms(all.clone().map(|row| row.value("rms_mm")))),
            format!("{:.3}", worst(all.clone().map(shift_mm))),
            format!("{:.4}", worst(all.map(turn_deg))),
            format!("{:.3}", worst(of(rows, class, "first").map(shift_mm))),
        ]);
    }
    let mut blocks = vec![Block::Words(WORDS.to_owned()), Block::Table(table)];
    let [place, angle] = worst_of_all(rows);
    if part(rows, "tones").next().is_some() {
        blocks.push(Block::Checks(vec![
            Check::at_most(
                "worst position error on any skin tone, in mm",
                place,
                TOLERANCE[0],
            ),
            Check::at_most(
                "worst angle error on any skin tone, in degrees",
                angle,
                TOLERANCE[1],
            ),
        ]));
    }
    Section::new("Skin tones", blocks)
}
