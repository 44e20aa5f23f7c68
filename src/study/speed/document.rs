//! The study's page: rates of the passes, what options of the decoder cost, and the links: latency and
//! frames a second.

use crate::speed::links::Link;
use phasmid_report::lab::{
    Block, Chart, Check, Figure, Row, Rows, Section, Series, SeriesStyle, Table,
};
use phasmid_report::plot::figures;

/// All sections.
pub fn sections(rows: &Rows) -> Vec<Section> {
    vec![passes(rows), options(rows), links(rows)]
}

fn passes(rows: &Rows) -> Section {
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
fn options(rows: &Rows) -> Section {
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

/// Bytes of a megabyte, as rates of links count them.
const MEGA: f64 = 1e6;

fn links(rows: &Rows) -> Section {
    let [latency, throughput] =
        ["latency", "throughput"].map(|group| rows.with("group", group).collect::<Vec<_>>());
    let mut blocks = vec![
        Block::Words(
            "A device of the bench on the fast clock: exposures take no time, so that what is left is \
             what the rendering and the link take. In memory there is no link: the device is called \
             on the host's own thread, and renders a frame when the host asks for it. Over the links \
             it is threads of its own, which render the next frames of a sequence while the host \
             takes the last, so that a link can carry more frames a second than are rendered in \
             memory. Links take turns, some rounds long. All carry the \
             embedded data line, by which V4L2 tells frames. USB/IP is read by the host's own \
             drivers; USB of the kernel is the same device handed to vhci_hcd and read as \
             /dev/videoN, its port as /dev/ttyACMN."
                .to_owned(),
        ),
        Block::Table(facts(&latency, &throughput)),
        Block::Table(latencies(&latency)),
        Block::Table(rates(&throughput)),
    ];
    for row in &latency {
        let (name, why) = (row.get("name"), row.get("note"));
        match row.get("state") {
            "lacking" => {
                let words = format!("{name} is left out, this machine lacks it: {why}.");
                blocks.push(Block::Words(words));
            }
            "broken" => blocks.push(Block::Words(format!("{name} does not work: {why}."))),
            _ => {}
        }
    }
    for row in throughput.iter().filter(|row| row.get("state") == "broken") {
        let (name, why) = (row.get("name"), row.get("note"));
        blocks.push(Block::Words(format!("{name} carries no sequence: {why}.")));
    }
    let points = points(&latency, &throughput);
    if !points.is_empty() {
        let chart = Chart {
            heading: String::new(),
            x: "latency, ms: median, 99th percentile".to_owned(),
            y: "frames a second".to_owned(),
            log: [true; 2],
            series: points,
        };
        blocks.push(Block::Figure(Figure {
            name: "speed-links".to_owned(),
            caption: "Links by what they take from a trigger's command to the whole frame, and by \
                      the frames of a sequence that they carry a second."
                .to_owned(),
            sheet: chart.sheet(),
        }));
    }
    blocks.push(Block::Checks(checks(&latency, &throughput)));
    Section {
        title: "Links".to_owned(),
        blocks,
    }
}

fn there(row: &&&Row) -> bool {
    row.get("state").is_empty()
}

fn link(row: &Row) -> Option<Link> {
    Link::named(row.get("name"))
}

fn by_chance(row: &Row) -> bool {
    link(row).is_none_or(Link::by_chance)
}

/// What is the same on all machines, so only of links that all of them have.
fn facts(latency: &[&Row], throughput: &[&Row]) -> Table {
    let mut table = Table::new(
        "speed-links",
        "Frames that came whole: triggered one by one, and in sequences, with those of them that were \
         lost.",
        &[
            "link",
            "one by one",
            "in sequences",
            "lost",
            "bytes of a frame",
        ],
    );
    for row in latency.iter().filter(there).filter(|row| !by_chance(row)) {
        let same = |other: &&&Row| other.get("name") == row.get("name");
        let other = throughput.iter().filter(there).find(same);
        let of = |column: &str| other.map_or("", |row| row.get(column)).to_owned();
        table.row([
            row.get("name").to_owned(),
            row.get("frames").to_owned(),
            of("frames"),
            of("lost"),
            row.get("bytes").to_owned(),
        ]);
    }
    table
}

fn latencies(rows: &[&Row]) -> Table {
    let mut table = Table::new(
        "speed-latency",
        "From the trigger's command to the whole frame at the host, in milliseconds, rendering of a \
         frame with noise included; the copy is of the frame's bytes.",
        &[
            "link",
            "median",
            "99th percentile",
            "least",
            "most",
            "copy",
        ],
    )
    .timed();
    for row in rows.iter().filter(there) {
        let ms = ["median_us", "p99_us", "least_us", "most_us", "copy_us"];
        let ms = ms.map(|column| figures(row.value(column) * 1e-3, 3));
        table.row(std::iter::once(row.get("name").to_owned()).chain(ms));
    }
    table
}

fn rates(rows: &[&Row]) -> Table {
    let mut table = Table::new(
        "speed-throughput",
        "Frames of sequences without noise at the host, from the trigger's command to the last of \
         them: median (quartiles) of the sequences, rendering included; over copy: the time of a \
         frame over that of a memory copy of its bytes. A V4L2 node overwrites what its reader does \
         not take in time: those frames are lost.",
        &["link", "frames/s", "MB/s", "over copy", "lost, %"],
    )
    .timed();
    for row in rows.iter().filter(there) {
        let [low, rate, high] = ["rate_low", "rate", "rate_high"].map(|name| row.value(name));
        let [low, middle, high] = [low, rate, high].map(|value| figures(value, 3));
        table.row([
            row.get("name").to_owned(),
            format!("{middle} ({low} to {high})"),
            figures(rate * row.value("bytes") / MEGA, 3),
            figures(1e6 / rate / row.value("copy_us"), 3),
            format!("{:.1}", 100.0 * row.value("lost") / row.value("frames")),
        ]);
    }
    table
}

/// A line from the median to the 99th percentile for each link that has both figures.
fn points(latency: &[&Row], throughput: &[&Row]) -> Vec<Series> {
    let series = latency.iter().filter(there).filter_map(|row| {
        let same = |other: &&&Row| other.get("name") == row.get("name");
        let rate = throughput.iter().filter(there).find(same)?.value("rate");
        let ms = ["median_us", "p99_us"].map(|column| (row.value(column) * 1e-3, rate));
        let mut one = Series::new(row.get("name"), SeriesStyle::Both, ms);
        one.tips = ["median", "99th percentile"].map(str::to_owned).into();
        Some(one)
    });
    series.collect()
}

fn checks(latency: &[&Row], throughput: &[&Row]) -> Vec<Check> {
    let all = || latency.iter().chain(throughput);
    let broken = all().filter(|row| row.get("state") == "broken").count();
    let lacking = all().filter(|row| row.get("state") == "lacking" && !by_chance(row));
    let lost = |row: &&&Row| link(row).is_some_and(|link| !link.overwrites());
    let lost = throughput.iter().filter(there).filter(lost);
    let lost: f64 = lost.map(|row| row.value("lost")).sum();
    vec![
        Check::at_most("links that do not work", broken as f64, 0.0),
        Check::at_most(
            "links that every machine has and this one lacks",
            lacking.count() as f64,
            0.0,
        ),
        Check::at_most("frames lost where a link waits for its reader", lost, 0.0),
    ]
}
