//! Formats figures for table cells, creates text blocks and plots, and finds the Pareto front.

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
    // Expensive settings are timed only once, so they have no quartiles.
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
    chart.figure(name, caption)
}

/// Returns whether each setting, given by cost and error, is on the Pareto front: no other setting has
/// at most the same cost and at most the same error, one of them smaller. Settings with missing figures
/// are not on the front.
pub(super) fn front(settings: &[[f64; 2]]) -> Vec<bool> {
    let sound = |s: &[f64; 2]| s.iter().all(|v| v.is_finite());
    let beats = |a: &[f64; 2], b: &[f64; 2]| {
        sound(a) && a[0] <= b[0] && a[1] <= b[1] && (a[0] < b[0] || a[1] < b[1])
    };
    let best = |s: &[f64; 2]| sound(s) && !settings.iter().any(|other| beats(other, s));
    settings.iter().map(best).collect()
}

#[cfg(test)]
mod tests {
    use super::front;

    #[test]
    fn a_setting_is_on_the_front_unless_another_beats_it() {
        let settings = [
            [1.0, 9.0],
            [2.0, 3.0],
            [2.0, 4.0],
            [3.0, 3.0],
            [5.0, 1.0],
            [0.5, f64::NAN],
            [6.0, 1.0],
        ];
        let found = front(&settings);
        assert_eq!(found, [true, true, false, false, true, false, false]);
        assert_eq!(front(&[[1.0, 1.0], [1.0, 1.0]]), [true, true], "equals");
        assert!(front(&[]).is_empty());
    }
}
