//! Reads and writes times in rows.

use crate::timing::Spread;
use phasmid_report::lab::Row;

/// The columns of this study.
pub const COLUMNS: &[&str] = &[
    "group",
    "device",
    "setting",
    "pass",
    "steps",
    "scale",
    "samples",
    "width",
    "height",
    "frames",
    "points",
    "inlier_rmse_mm",
    "crease_rmse_mm",
    "bound_mm",
    "ratio_to_bound",
    "held_mm",
    "ratio_less_held",
    "gross",
    "beyond_5_sigma",
    "coverage",
    "levels",
    "render_s",
    "render_s_low",
    "render_s_high",
    "decode_s",
    "decode_s_low",
    "decode_s_high",
    "ns",
    "ns_low",
    "ns_high",
    "without_ns",
    "without_ns_low",
    "without_ns_high",
    "tolerance_px",
    "keys_ms",
    "traced",
    "median_px",
    "most_px",
    "worst_px",
    "mean_px",
    "missed",
    "note",
];

/// Adds a time and its quartiles to a row.
pub fn times(row: Row, name: &str, spread: Spread) -> Row {
    row.number(name, spread.median)
        .number(&format!("{name}_low"), spread.low)
        .number(&format!("{name}_high"), spread.high)
}

/// Returns a time of a row and its quartiles.
pub fn spread(row: &Row, name: &str) -> Spread {
    Spread {
        low: row.value(&format!("{name}_low")),
        median: row.value(name),
        high: row.value(&format!("{name}_high")),
    }
}
