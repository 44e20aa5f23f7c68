//! How the page writes figures in the cells of its tables, and sets up its words and plots.

use crate::timing::Spread;
use phasmid_report::lab::{Block, Chart, Figure, Row, Series};
use phasmid_report::plot::figures;

pub(super) fn words(text: &str) -> Block {
    Block::Words(text.to_owned())
}

pub(super) fn um(mm: f64) -> String {
    figures(mm * 1e3, 3)
}

pub(super) fn percent(share: f64) -> String {
    if share.is_nan() {
        return "-".to_owned();
    }
    format!("{:.2}", share * 100.0)
}

pub(super) fn with_spread(spread: Spread, digits: usize) -> String {
    // Dear settings run once, which has no spread.
    if spread.low == spread.high {
        return format!("{} (once)", figures(spread.median, digits));
    }
    let [low, middle, high] =
        [spread.low, spread.median, spread.high].map(|value| figures(value, digits));
    format!("{middle} ({low} to {high})")
}

pub(super) fn of_bound(row: &Row, bound_um: f64) -> String {
    percent(row.value("inlier_rmse_mm") * 1e3 / bound_um)
}

pub(super) fn figure(name: &str, caption: &str, axes: [&str; 2], series: Vec<Series>) -> Figure {
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
