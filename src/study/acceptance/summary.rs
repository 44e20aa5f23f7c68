//! Requirements, published results of commercial systems, and our results. The published systems were
//! measured with other objects and methods, so their results only show the order of magnitude.

use super::answer::part;
use super::known::{BAR, TOLERANCE, worst_of_torso};
use super::{drift, frame, hidden, hold, tones};
use phasmid_report::lab::{Block, Rows, Section, Table};
use phasmid_report::plot::figures;

/// Text at the head of the page.
const WORDS: &str = "A clinic accepts a surface-guidance system by tests with phantoms on a couch \
    whose displacements are known. This study runs such tests with the three ceiling pods, the \
    decoder and the rigid tracker, on the data that a client of the ports receives. The couch is \
    exact, and so is the calibration except in the sections on the common frame and on drift: the \
    errors shown are those of pods and tracker. The published figures are of other systems, \
    measured on other bodies by other methods; they only indicate the order of magnitude.";

pub(super) fn section(rows: &Rows) -> Section {
    Section::new(
        "Summary",
        vec![Block::Words(WORDS.to_owned()), Block::Table(table(rows))],
    )
}

fn table(rows: &Rows) -> Table {
    let mut table = Table::new(
        "acceptance-summary",
        "Our results, the required limits, and published results of commercial systems. The host's \
         times, which differ from run to run, are in the table of latencies.",
        &["", "ours", "asked", "published", "of"],
    );
    let mut row = |(of, what): (&str, &str),
                   ours: &[(f64, &str)],
                   asked: String,
                   published: Option<Published>| {
        // A part of the study that was not run has no row in the table; a failed part has a row
        // without a number.
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
        Some(PUBLISHED_SHIFTS),
    );
    let [place, angle] = frame::worst_by_boards(rows);
    row(
        (
            "frame",
            "still torso, pods calibrated and located by boards",
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
            Some(PUBLISHED_DRIFT),
        );
    }
    let [place, pixels, _] = drift::noise(rows);
    row(
        ("drift", "noise of the tracked position"),
        &[(place, "mm")],
        "-".to_owned(),
        Some(PUBLISHED_NOISE),
    );
    row(
        ("drift", "noise of a pixel's depth"),
        &[(pixels, "mm")],
        "-".to_owned(),
        None,
    );
    row(
        ("hidden", "one pod hidden, change of the position"),
        &[(hidden::largest_mm(rows), "mm")],
        format!("{} mm", TOLERANCE[0]),
        Some(PUBLISHED_HIDDEN),
    );
    row(
        ("hold", "beam-hold, worst device time"),
        &[(hold::longest_ms(rows), "ms")],
        "500 ms including the host's time".to_owned(),
        Some(PUBLISHED_HOLD),
    );
    table
}

/// A published result comparable with ours, and its source.
#[derive(Debug, Clone, Copy)]
struct Published {
    /// As published, with the unit.
    figure: &'static str,
    /// Publication, and the quantity measured there.
    source: &'static str,
}

const PUBLISHED_SHIFTS: Published = Published {
    figure: "at most 0.3 mm, 0.2 deg",
    source: "Looe et al., arXiv:2604.00589 (2026): LUNA 3D, largest deviation of shifts of a phantom, \
             the reference surface captured by the system (0.8 mm with one from the CT)",
};

const PUBLISHED_DRIFT: Published = Published {
    figure: "below 0.4 mm",
    source: "Looe et al., arXiv:2604.00589 (2026): LUNA 3D, drift with temperature, each axis",
};

const PUBLISHED_NOISE: Published = Published {
    figure: "0.04 to 0.06 mm",
    source: "Liu et al., J Appl Clin Med Phys (2025), doi 10.1002/acm2.70138, and an abstract of the \
             AAPM's meeting of 2026 on the same system: LUNA 3D, RMS noise of the tracked shift of a \
             head phantom at rest, not of its points",
};

const PUBLISHED_HIDDEN: Published = Published {
    figure: "0.50 and 0.80 mm",
    source: "J Appl Clin Med Phys (2023), PMC10562042: IDENTIFY, medians of the reported offsets of \
             patients with white and with black skin while the gantry hides a pod, the patients' own \
             motion among them",
};

const PUBLISHED_HOLD: Published = Published {
    figure: "131 to 149 ms",
    source: "Naylor, Barlow and Papangelou, Phys Med (2025), doi 10.1016/j.ejmp.2025.105181: AlignRT \
             on TrueBeam and Versa HD, means of beam-hold latency from motion to dose, the linac's part \
             of it among them",
};
