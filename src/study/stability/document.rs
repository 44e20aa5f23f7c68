//! Tables, charts and checks of the study, from its rows alone.

use super::case::{Group, Sweep, checks};
use phasmid_report::lab::{Block, Chart, Figure, Row, Rows, Section, Series, SeriesStyle, Table};
use phasmid_report::plot::figures;

/// Minimum number of cases for a chart.
const FEWEST: usize = 3;

/// Text above the tables.
const WORDS: &str = "Each case has an oracle: a closed form, or an independent computation in f64. \
    The allowed error follows from first-order analysis of rounding, noise and the case's \
    condition, not from the errors found. Where the allowed error is a bound on the worst pixel, \
    the error comes close to it with few steps, where rounding can have the same sign in every \
    frame, and stays below half of it with many. Near two pixels per period, a third of the pixels \
    is left out (those on an edge of the code), and none is wrong.";

pub(super) fn sections(rows: &Rows, groups: &[Group]) -> Vec<Section> {
    let mut sections = vec![overview(rows, groups)];
    sections.extend(groups.iter().map(|group| section(group, rows)));
    sections
}

/// Tabulates one line per sweep.
fn overview(rows: &Rows, groups: &[Group]) -> Section {
    let caption = "Number of cases with an answer within the error that first-order analysis \
        allows (held), without an answer but with a message (refused), and with neither (failed). \
        The ratio is a condition number or a ratio of scales, from the first to the last case; the \
        worst error is relative to the allowed error.";
    let header = [
        "sweep",
        "ratio",
        "from",
        "to",
        "held",
        "refused",
        "failed",
        "worst error / allowed",
    ];
    let mut table = Table::new("stability", caption, &header);
    for sweep in groups.iter().flat_map(|group| group.sweeps) {
        let of: Vec<&Row> = rows.of(sweep.key).collect();
        let count = |outcome: &str| of.iter().filter(|r| r.get("outcome") == outcome).count();
        let ratios = of.iter().map(|row| row.value("ratio"));
        let finite = ratios.filter(|ratio| ratio.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), r| {
            (low.min(r), high.max(r))
        });
        let over = of
            .iter()
            .map(|row| row.value("found") / row.value("allowed"));
        let worst = over.filter(|v| v.is_finite()).fold(f64::NAN, f64::max);
        table.row([
            sweep.key.to_owned(),
            sweep.ratio.to_owned(),
            figures(low, 3),
            figures(high, 3),
            count("held").to_string(),
            count("refused").to_string(),
            count("FAILED").to_string(),
            match sweep.rounding && worst <= 1.0 {
                true => "below 1".to_owned(),
                false => figures(worst, 2),
            },
        ]);
    }
    Section::new(
        "All sweeps",
        vec![
            Block::Words(WORDS.to_owned()),
            Block::Table(table),
            Block::Table(breaks(rows, groups)),
        ],
    )
}

/// Tabulates where sweeps begin to give no answer, and the program's message there.
fn breaks(rows: &Rows, groups: &[Group]) -> Table {
    let caption = "Where methods break: for each sweep, the last case with an answer, the first \
        case without one, and the program's message.";
    let header = ["sweep", "last answer", "first refusal", "says"];
    let mut table = Table::new("stability-breaks", caption, &header);
    for sweep in groups.iter().flat_map(|group| group.sweeps) {
        let mut held = "-";
        for row in rows.of(sweep.key) {
            if row.get("outcome") != "refused" {
                held = row.get("case");
                continue;
            }
            let (first, says) = (row.get("case"), short(row.get("says")));
            table.row([sweep.key, held, first, &says]);
            break;
        }
    }
    table
}

/// Shortens a message to fit a table.
fn short(says: &str) -> String {
    const MOST: usize = 120;
    if says.chars().count() <= MOST {
        return says.to_owned();
    }
    let begin: String = says.chars().take(MOST).collect();
    format!("{begin} ...")
}

fn section(group: &Group, rows: &Rows) -> Section {
    let mut blocks = Vec::new();
    for sweep in group.sweeps {
        let of: Vec<&Row> = rows.of(sweep.key).collect();
        blocks.push(Block::Table(table(sweep, &of).detail()));
        blocks.extend(figure(sweep, &of).map(Block::Figure));
        blocks.push(Block::Checks(checks(sweep.key, &of)));
    }
    Section {
        title: group.title.to_owned(),
        blocks,
    }
}

fn table(sweep: &Sweep, rows: &[&Row]) -> Table {
    let caption = format!("{}. {}", sweep.title, sweep.oracle);
    let kept = rows.iter().any(|row| row.value("kept").is_finite());
    let (found, allowed) = (format!("{}: found", sweep.error), "allowed".to_owned());
    let mut header = vec!["case", sweep.ratio, &found, &allowed];
    if kept {
        header.push("answered");
    }
    header.extend(["outcome", "says"]);
    let mut table = Table::new(&format!("stability-{}", sweep.key), caption, &header);
    for row in rows {
        let found = row.value("found");
        let mut cells = vec![
            row.get("case").to_owned(),
            figures(row.value("ratio"), 3),
            match sweep.rounding {
                true => decade(found),
                false => figures(found, 2),
            },
            figures(row.value("allowed"), 2),
        ];
        if kept {
            cells.push(share(row.value("kept")));
        }
        cells.push(row.get("outcome").to_owned());
        cells.push(short(row.get("says")));
        table.row(cells);
    }
    table
}

fn share(share: f64) -> String {
    match share.is_finite() {
        true => format!("{:.1} %", 100.0 * share),
        false => "all".to_owned(),
    }
}

/// Formats a rounding error by the power of ten above it, because its digits depend on the machine.
fn decade(error: f64) -> String {
    if !error.is_finite() {
        return "-".to_owned();
    }
    if error <= 1e-300 {
        return "0".to_owned();
    }
    format!("< 1e{}", error.log10().floor() as i32 + 1)
}

/// Plots found and allowed errors over the ratio.
fn figure(sweep: &Sweep, rows: &[&Row]) -> Option<Figure> {
    let points = |name: &str| -> Vec<(f64, f64)> {
        let all = rows.iter().map(|row| (row.value("ratio"), row.value(name)));
        all.filter(|(x, y)| *x > 0.0 && *y > 0.0).collect()
    };
    let (found, allowed) = (points("found"), points("allowed"));
    // Zero has no position on a logarithmic axis.
    if allowed.len() < FEWEST || found.is_empty() {
        return None;
    }
    let mut sorted = allowed;
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let chart = Chart {
        heading: sweep.title.to_owned(),
        x: sweep.ratio.to_owned(),
        y: sweep.error.to_owned(),
        log: [true, true],
        series: vec![
            Series::new("found", SeriesStyle::Dots, found),
            Series::new("allowed", SeriesStyle::Dashed, sorted),
        ],
    };
    Some(chart.figure(
        &format!("stability-{}", sweep.key),
        format!(
            "{}: error found and error allowed, against {}.",
            sweep.title, sweep.ratio
        ),
    ))
}
