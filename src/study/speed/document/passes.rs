//! Rates of the passes, and what options of the decoder cost.

use phasmid_report::lab::{Block, Check, Row, Rows, Section, Table};
use phasmid_report::plot::figures;

pub(super) fn section(rows: &Rows) -> Section {
    let passes: Vec<&Row> = rows.with("group", "pass").collect();
    let mut facts = Table::new(
        "speed-passes",
        "What is timed: pixels (of a refit, triangles), frames of a run, bytes of a pixel that are \
         read or written once, which are those of the memory copy beside it.",
        &["pass", "pixels", "frames", "bytes a pixel"],
    );
    let mut rates = Table::new(
        "speed-pass-rates",
        "Fastest of the runs, on all threads; the copy is of the same bytes on one thread, in turns \
         with the pass.",
        &["pass", "ms", "Mpixel/s", "ns/px", "copy, ms", "over copy"],
    )
    .timed();
    for row in &passes {
        let name = row.get("name").to_owned();
        facts.row([
            name.clone(),
            row.get("pixels").to_owned(),
            row.get("frames").to_owned(),
            row.get("bytes").to_owned(),
        ]);
        rates.row(rate(name, row));
    }
    let mut blocks = vec![
        Block::Words(
            "A pass cannot be faster than a copy of the bytes that it has to touch, so the copy in \
             the same run is what its time is held against."
                .to_owned(),
        ),
        Block::Table(facts),
        Block::Table(rates),
    ];
    let mut gpu = Table::new(
        "speed-gpu",
        "Frames of the GPU from their order to their bytes, one after the other.",
        &[
            "adapter",
            "what",
            "ms",
            "Mpixel/s",
            "ns/px",
            "copy, ms",
            "over copy",
        ],
    )
    .timed();
    for row in rows.with("group", "gpu") {
        if !row.get("note").is_empty() {
            let why = format!("The GPU's rows are left out: {}.", row.get("note"));
            blocks.push(Block::Words(why));
            continue;
        }
        let cells = rate(row.get("name").to_owned(), row);
        gpu.row(std::iter::once(row.get("adapter").to_owned()).chain(cells));
    }
    if !gpu.rows.is_empty() {
        blocks.push(Block::Table(gpu));
    }
    let slowest = passes.iter().map(|row| row.value("pass_us"));
    let measured = slowest.filter(|us| *us > 0.0).count();
    blocks.push(Block::Checks(vec![Check::at_most(
        "passes without a rate",
        passes.len() as f64 - measured as f64,
        0.0,
    )]));
    Section {
        title: "Passes".to_owned(),
        blocks,
    }
}

fn rate(name: String, row: &Row) -> [String; 6] {
    let (us, copy, pixels) = (
        row.value("pass_us"),
        row.value("copy_us"),
        row.value("pixels"),
    );
    [
        name,
        figures(us * 1e-3, 3),
        figures(pixels / us, 3),
        figures(us * 1e3 / pixels, 3),
        figures(copy * 1e-3, 3),
        figures(us / copy, 3),
    ]
}

/// Ratios, but of times all the same.
pub(super) fn options(rows: &Rows) -> Section {
    let mut table = Table::new(
        "speed-options",
        "Decoding to depths, all pixels lit, without an option and with it, in turns: fastest of the \
         runs.",
        &["option", "without, ms", "with, ms", "ratio"],
    )
    .timed();
    for row in rows.with("group", "pair") {
        let [without, with] = ["without_us", "pass_us"].map(|name| row.value(name));
        table.row([
            row.get("name").to_owned(),
            figures(without * 1e-3, 3),
            figures(with * 1e-3, 3),
            figures(with / without, 3),
        ]);
    }
    let about = "The decoder refuses single pixels whose steps contradict each other, unless it is \
                 told not to; it weighs steps by their shot noise where that is asked for \
                 (--weighted). cargo bench holds the first to a tenth of the decoding.";
    Section {
        title: "Options of the decoder".to_owned(),
        blocks: vec![Block::Words(about.to_owned()), Block::Table(table)],
    }
}
