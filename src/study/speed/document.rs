//! The study's page.

use crate::measure::plot::figures;
use crate::study::lab::{
    Block, Chart, Check, Document, Figure, Look, Row, Rows, Section, Series, Table,
};

/// All of it.
pub fn document(rows: &Rows) -> Document {
    Document {
        title: "Speed".to_owned(),
        sections: vec![of_passes(rows), of_links(rows)],
    }
}

fn of_passes(rows: &Rows) -> Section {
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

fn of_links(rows: &Rows) -> Section {
    let links: Vec<&Row> = rows.with("group", "latency").collect();
    let there = |row: &&&Row| row.get("note").is_empty();
    let mut facts = Table::new(
        "speed-links",
        "Frames that were triggered one by one and came whole.",
        &["link", "frames", "bytes of a frame"],
    );
    let mut times = Table::new(
        "speed-latency",
        "From the trigger's command to the whole frame at the host, in milliseconds, rendering \
         included; the copy is of the frame's bytes.",
        &["link", "median", "99th percentile", "least", "most", "copy"],
    )
    .timed();
    for row in links.iter().filter(there) {
        let name = row.get("name").to_owned();
        if !by_chance(row) {
            facts.row([
                name.clone(),
                row.get("frames").to_owned(),
                row.get("bytes").to_owned(),
            ]);
        }
        let ms = ["median_us", "p99_us", "least_us", "most_us", "copy_us"];
        let ms = ms.map(|column| figures(row.value(column) * 1e-3, 3));
        times.row(std::iter::once(name).chain(ms));
    }
    let mut blocks = vec![
        Block::Words(
            "A frame of the bench before the trapezoid, its device on the fast clock: the exposure \
             takes no time, so that what is left is what the rendering and the link take. In memory \
             there is no link: that row is the rendering and the firmware, and the others less that \
             are their links."
                .to_owned(),
        ),
        Block::Table(facts),
        Block::Table(times),
    ];
    for row in links.iter().filter(|row| !there(row)) {
        let words = format!("{} is not there: {}.", row.get("name"), row.get("note"));
        blocks.push(Block::Words(words));
    }
    let points = |column: &str| {
        let ms = links.iter().filter(there).enumerate();
        let ms = ms.map(|(i, row)| (i as f64 + 1.0, row.value(column) * 1e-3));
        ms.collect::<Vec<_>>()
    };
    let mut median = Series::new("median", Look::Both, points("median_us"));
    median.tips = links
        .iter()
        .filter(there)
        .map(|row| row.get("name").to_owned())
        .collect();
    let chart = Chart {
        heading: String::new(),
        x: "link, in the order of the table".to_owned(),
        y: "latency, ms".to_owned(),
        log: [false, true],
        series: vec![
            median,
            Series::new("99th percentile", Look::Dots, points("p99_us")),
        ],
    };
    blocks.push(Block::Figure(Figure {
        name: "speed-latency".to_owned(),
        caption: "From the trigger's command to the whole frame.".to_owned(),
        sheet: chart.sheet(),
    }));
    let missing = links
        .iter()
        .filter(|row| !there(row) && !by_chance(row))
        .count();
    blocks.push(Block::Checks(vec![Check::at_most(
        "links without a latency, V4L2 aside",
        missing as f64,
        0.0,
    )]));
    Section {
        title: "Latency".to_owned(),
        blocks,
    }
}

/// Links that are there on some machines only.
fn by_chance(row: &Row) -> bool {
    let name = row.get("name");
    name.ends_with("V4L2") || (cfg!(not(target_os = "linux")) && name != "in memory")
}
