//! What is asked of such systems, what was published of some, and what ours does.

use super::answer::part;
use super::known::{BAR, TOLERANCE, worst_of_torso};
use super::published::{self, Published};
use super::{drift, frame, hidden, hold, tones};
use phasmid_report::lab::{Block, Rows, Section, Table};
use phasmid_report::plot::figures;

pub(super) fn section(rows: &Rows) -> Section {
    Section {
        title: "Summary".to_owned(),
        blocks: vec![
            Block::Words(super::words::WHAT.to_owned()),
            Block::Table(table(rows)),
        ],
    }
}

fn table(rows: &Rows) -> Table {
    let mut table = Table::new(
        "acceptance-summary",
        "Ours beside what is asked and what was published of commercial systems. Times of the host, \
         which no second run repeats, are in the table of latencies.",
        &["", "ours", "asked", "published", "of"],
    );
    let mut row = |(of, what): (&str, &str),
                   ours: &[(f64, &str)],
                   asked: String,
                   published: Option<Published>| {
        // A part that was not run has no line; one without an answer has one without a figure.
        if part(rows, of).next().is_none() {
            return;
        }
        let ours: Vec<String> = ours
            .iter()
            .map(|(value, unit)| format!("{} {unit}", figures(*value, 2)))
            .collect();
        let (figure, source) = published.map_or(("-", "-"), |p| (p.figure, p.source));
        table.row([
            what.to_owned(),
            ours.join(", "),
            asked,
            figure.to_owned(),
            source.to_owned(),
        ]);
    };
    let tolerance = || format!("{} mm, {} deg", TOLERANCE[0], TOLERANCE[1]);
    let [place, angle] = worst_of_torso(rows, 0);
    row(
        ("known", "still torso, worst error"),
        &[(place, "mm"), (angle, "deg")],
        format!("{} mm, {} deg", BAR[0], BAR[1]),
        Some(published::SHIFTS),
    );
    let [place, angle] = frame::worst_by_boards(rows);
    row(
        (
            "frame",
            "still torso, pods that boards have calibrated and located",
        ),
        &[(place, "mm"), (angle, "deg")],
        format!("{} mm, {} deg", BAR[0], BAR[1]),
        None,
    );
    let [place, angle] = tones::worst_of_all(rows);
    row(
        ("tones", "patient of any skin tone, worst error"),
        &[(place, "mm"), (angle, "deg")],
        tolerance(),
        None,
    );
    for (case, what) in [
        ("light", "drift over an hour, fading light"),
        ("heat", "drift over an hour, pods 5 K warmer"),
    ] {
        let [place, angle] = drift::largest(rows, case);
        row(
            ("drift", what),
            &[(place, "mm"), (angle, "deg")],
            tolerance(),
            Some(published::DRIFT),
        );
    }
    let [place, pixels, _] = drift::noise(rows);
    row(
        ("drift", "noise of the tracked place"),
        &[(place, "mm")],
        "-".to_owned(),
        Some(published::NOISE),
    );
    row(
        ("drift", "noise of a pixel's depth"),
        &[(pixels, "mm")],
        "-".to_owned(),
        None,
    );
    row(
        ("hidden", "one pod hidden, change of the place"),
        &[(hidden::largest_mm(rows), "mm")],
        format!("{} mm", TOLERANCE[0]),
        Some(published::HIDDEN),
    );
    row(
        ("hold", "beam-hold, device time at worst"),
        &[(hold::longest_ms(rows), "ms")],
        "500 ms with the host's".to_owned(),
        Some(published::HOLD),
    );
    table
}
