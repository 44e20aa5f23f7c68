//! Frames by the GPU: the table.

use super::{of_bound, um, with_spread};
use crate::work_precision::row::spread;
use phasmid_report::lab::{Block, Row, Section, Table};

/// All of it is of the adapter at hand, and so in a table of times.
pub(super) fn section(gpu: &[&Row], best: &[bool], bound_um: f64) -> Section {
    let mut table = Table::new(
        "work-precision-gpu",
        "The same frames by the GPU: a frame's time is from its order to its bytes; * is on the Pareto \
         front of the processor's frames and these.",
        &[
            "adapter",
            "rays",
            "smooth, RMSE um",
            "of noise bound, %",
            "edges, RMSE um",
            "ns/px",
            "",
        ],
    )
    .timed();
    let mut blocks = Vec::new();
    // Rows without figures have no place on the front.
    let mut best = best.iter();
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
            match best.next() {
                Some(true) => "*",
                _ => "",
            }
            .to_owned(),
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
