//! The study's page.

mod frames;
mod grid;
mod scans;
mod terms;

use super::row::spread;
use crate::measure::plot::figures;
use crate::study::lab::{
    Block, Chart, Document, Figure, Row, Rows, Section, Series, Settings, Table,
};
use crate::study::timing::Spread;

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
        sections.push(frames::section(&frames, bound_um));
    }
    if !gpu.is_empty() {
        sections.push(of_gpu(&gpu, bound_um));
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

/// All of it is of the adapter at hand, and so in a table of times.
fn of_gpu(gpu: &[&Row], bound_um: f64) -> Section {
    let mut table = Table::new(
        "work-precision-gpu",
        "The same frames by the GPU: a frame's time is from its order to its bytes.",
        &[
            "adapter",
            "rays",
            "smooth, RMSE um",
            "of noise bound, %",
            "edges, RMSE um",
            "ns/px",
        ],
    )
    .timed();
    let mut blocks = Vec::new();
    for row in gpu {
        if !row.get("note").is_empty() {
            let why = format!("The GPU's rows are left out: {}.", row.get("note"));
            blocks.push(Block::Words(why));
            continue;
        }
        table.row([
            row.get("adapter").to_owned(),
            row.get("samples").to_owned(),
            um(row.value("inlier_rmse_mm")),
            of_bound(row, bound_um),
            um(row.value("crease_rmse_mm")),
            with_spread(spread(row, "ns"), 3),
        ]);
    }
    if !table.rows.is_empty() {
        blocks.push(Block::Table(table));
    }
    Section {
        title: "The processor and the GPU".to_owned(),
        blocks,
    }
}
