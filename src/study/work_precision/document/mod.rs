//! The study's page.

mod frames;
mod gpu;
mod grid;
mod scans;
mod terms;

use crate::timing::Spread;
use phasmid_report::lab::{Block, Chart, Document, Figure, Row, Rows, Series, Settings};
use phasmid_report::plot::figures;

/// All of it.
pub fn document(rows: &Rows, settings: &Settings) -> Document {
    let group = |name| rows.with("group", name).collect::<Vec<&Row>>();
    let [scans, frames, gpu, terms] = ["scan", "frames", "gpu", "term"].map(group);
    let bound_um = bound_um(&scans);
    // A part that was not asked for has no rows, and says nothing.
    let mut sections = Vec::new();
    if !scans.is_empty() {
        sections.push(scans::section(&scans, settings));
    }
    if !frames.is_empty() {
        sections.extend(frames::sections(&frames, &gpu, bound_um));
    }
    if !terms.is_empty() {
        sections.push(terms::section(&terms, bound_um));
    }
    Document {
        title: "Error against run time".to_owned(),
        sections,
    }
}

fn words(text: &str) -> Block {
    Block::Words(text.to_owned())
}

fn um(mm: f64) -> String {
    figures(mm * 1e3, 3)
}

fn percent(share: f64) -> String {
    if share.is_nan() {
        return "-".to_owned();
    }
    format!("{:.2}", share * 100.0)
}

fn with_spread(spread: Spread, digits: usize) -> String {
    // Dear settings run once, which has no spread.
    if spread.low == spread.high {
        return format!("{} (once)", figures(spread.median, digits));
    }
    let [low, middle, high] =
        [spread.low, spread.median, spread.high].map(|value| figures(value, digits));
    format!("{middle} ({low} to {high})")
}

/// The noise bound of twelve steps at the bench's resolution, which figures without noise are held
/// against, in micrometres.
fn bound_um(scans: &[&Row]) -> f64 {
    let usual = scans.iter().find(|row| {
        row.value("steps") == 12.0 && row.value("scale") == 1.0 && row.value("samples") == 1.0
    });
    usual.map_or(f64::NAN, |row| row.value("bound_mm") * 1e3)
}

fn of_bound(row: &Row, bound_um: f64) -> String {
    percent(row.value("inlier_rmse_mm") * 1e3 / bound_um)
}

fn figure(name: &str, caption: &str, axes: [&str; 2], series: Vec<Series>) -> Figure {
    let chart = Chart {
        heading: String::new(),
        x: axes[0].to_owned(),
        y: axes[1].to_owned(),
        log: [true; 2],
        series,
    };
    Figure {
        name: name.to_owned(),
        caption: caption.to_owned(),
        sheet: chart.sheet(),
    }
}
