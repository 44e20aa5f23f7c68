//! Key figures at the head of the page.

use super::html::{cell, note, table, words};
use crate::report::summary::Summary;
use phasmid_report::plot::{escaped, figures};

pub(super) fn head(summary: &Summary) -> String {
    let mut out = about(summary);
    let (c, p) = (&summary.camera, &summary.projector);
    let row = |name: &str, a: f64, b: f64, unit: &str| {
        let number = |v: f64| cell(format!("{} {unit}", figures(v, 3)).trim_end());
        vec![cell(name), number(a), number(b)]
    };
    let count = |n: usize| cell(&n.to_string());
    let rows = [
        vec![cell("points"), count(c.points), count(p.points)],
        row("mean reprojection error", c.mean_px, p.mean_px, "px"),
        row("RMS reprojection error", c.rms_px, p.rms_px, "px"),
        row("largest", c.max_px, p.max_px, "px"),
        row("whitened RMS", c.whitened_rms, p.whitened_rms, ""),
        row(
            "covariances multiplied by",
            summary.inflation[0],
            summary.inflation[1],
            "",
        ),
        vec![
            cell("distortion estimated"),
            cell(&listed(&summary.camera_coefficients)),
            cell(&listed(&summary.projector_coefficients)),
        ],
    ];
    out.push_str(&table(&["", "camera", "projector"], rows));
    out.push_str(&note(&format!(
        "Poses used: {}. Outliers: {}. Variance factor: {} over {} degrees of freedom. Rounds of \
         solving: {}; a dot's centroid lies up to {} px from the image of its centre, and another \
         round would move a point by up to {} px. The projector's errors are plain distances: what \
         a camera point's own error does is in them, and in the standard deviations that points.csv \
         gives beside them; the whitened residuals are free of it. \
         Whitened RMS and variance factor are 1 where the covariances of the points are right.",
        summary.poses,
        summary.outliers,
        figures(summary.variance_factor, 4),
        summary.degrees_of_freedom,
        summary.rounds,
        figures(summary.largest_bias_px, 2),
        figures(summary.last_move_px, 2),
    )));
    for warning in &summary.warnings {
        let warning = escaped(warning);
        out.push_str(&format!("<p class=\"warning\">Warning: {warning}</p>\n"));
    }
    if !summary.left_out.is_empty() {
        let rows = summary.left_out.iter();
        let rows = rows.map(|pose| vec![cell(&pose.name), words(&pose.why)]);
        out.push_str(&table(&["left out", "why"], rows));
    }
    out
}

fn about(summary: &Summary) -> String {
    let [columns, rows] = summary.board.grid();
    let pitch = figures(summary.board.pitch_mm(), 4);
    let kind = match summary.board {
        phasmid_geometry::Board::Dots { .. } => "dots",
        phasmid_geometry::Board::Chess { .. } => "corners",
    };
    let board = format!("{columns} x {rows} {kind}, pitch {pitch} mm");
    let own = [("made by", summary.made_by.as_str()), ("board", &board)];
    let others = summary
        .remarks
        .iter()
        .map(|(n, v)| (n.as_str(), v.as_str()));
    let all = own.into_iter().chain(others);
    table(
        &["", ""],
        all.map(|(name, value)| vec![cell(name), words(value)]),
    )
}

fn listed(names: &[&str]) -> String {
    if names.is_empty() {
        "none".to_owned()
    } else {
        names.join(" ")
    }
}
