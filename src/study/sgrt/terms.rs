//! Effects that an ideal skin does not have. Each in turn is left out of the scan.

use super::paired::{Spread, difference, values};
use super::tables::interval;
use glam::DVec3;
use phasmid_report::lab::{Block, Rows, Table};

/// An effect: its name, the input with it and the input without it.
const TERMS: [(&str, &str, &str); 6] = [
    ("noise of 0.5 mm on an ideal skin", "noisy", "ideal"),
    ("regions that no pod sees", "seen", "ideal"),
    ("motion while the pods take turns", "scanned", "still"),
    ("light transport in skin", "still", "opaque"),
    ("sensor noise", "opaque", "quiet"),
    ("fringes, decoding and pixels", "quiet", "seen"),
];

pub(super) fn blocks(rows: &Rows, patients: &[&str]) -> Vec<Block> {
    vec![
        Block::Table(terms(rows, patients)),
        Block::Table(skins(rows, patients)),
    ]
}

fn terms(rows: &Rows, patients: &[&str]) -> Table {
    let mut table = Table::new(
        "sgrt-terms",
        "Effect of each term on the results for the tumour: position error (mm) and Dice's \
         coefficient with the term minus those without it at the same moment, as means over the \
         patients with 95 % confidence intervals; and the mean distance (mm) by which the term \
         moves the tracked position.",
        &[
            "term",
            "position error",
            "95 % interval",
            "Dice",
            "95 % interval",
            "shift of the position",
        ],
    );
    for (name, with, without) in TERMS {
        let pair = |column| [(with, column), (without, column)];
        let [position, dice] =
            ["tpe_mm", "dice"].map(|column| difference(rows, patients, pair(column)));
        table.row([
            name.to_owned(),
            format!("{:+.3}", position.mean),
            interval(position),
            format!("{:+.4}", dice.mean),
            interval(dice),
            format!("{:.3}", apart(rows, patients, [with, without])),
        ]);
    }
    let late = difference(
        rows,
        patients,
        [("scanned", "late_mm"), ("scanned", "tpe_mm")],
    );
    table.row([
        "tumour motion from the middle to the end of the scan".to_owned(),
        format!("{:+.3}", late.mean),
        interval(late),
        "-".to_owned(),
        "-".to_owned(),
        "-".to_owned(),
    ]);
    table
}

/// Returns the mean distance between the positions tracked with two inputs.
fn apart(rows: &Rows, patients: &[&str], inputs: [&str; 2]) -> f64 {
    let mut all = Vec::new();
    for patient in patients {
        let [a, b] = inputs.map(|input| {
            let [x, y, z] = ["error_x_mm", "error_y_mm", "error_z_mm"]
                .map(|column| values(rows, input, patient, column));
            let places = x.iter().zip(&y).zip(&z);
            let places = places.map(|((x, y), z)| DVec3::new(*x, *y, *z));
            places.collect::<Vec<_>>()
        });
        all.extend(a.iter().zip(&b).map(|(a, b)| a.distance(*b)));
    }
    all.retain(|d| d.is_finite());
    Spread::of(&all).mean
}

/// Tabulates the scanner's errors of the skin itself.
fn skins(rows: &Rows, patients: &[&str]) -> Table {
    let mut table = Table::new(
        "sgrt-skin",
        "The scanned skin compared with the true skin at the same moment, over all points of all \
         pods: mean and RMS of measured minus true depth of the inliers, share of points that are \
         more than 1 mm off, and of points that are off by more than 5 of the standard deviations \
         that the decoder states; means over the moments of all patients. Coverage is the share of \
         the tracked skin that has points.",
        &[
            "skin",
            "bias in mm",
            "RMS in mm",
            "gross in %",
            "beyond 5 sigma in %",
            "coverage in %",
        ],
    );
    let names = [
        ("still patient", "still"),
        ("still patient, opaque skin", "opaque"),
        ("still patient, opaque skin, no noise", "quiet"),
    ];
    for (name, input) in names {
        let mean = |column| {
            let all = patients.iter();
            let all: Vec<f64> = all
                .flat_map(|patient| values(rows, input, patient, column))
                .filter(|v| v.is_finite())
                .collect();
            Spread::of(&all).mean
        };
        table.row([
            name.to_owned(),
            format!("{:+.3}", mean("skin_bias_mm")),
            format!("{:.3}", mean("skin_rmse_mm")),
            format!("{:.2}", 100.0 * mean("skin_gross")),
            format!("{:.2}", 100.0 * mean("skin_beyond_5_sigma")),
            format!("{:.1}", 100.0 * mean("skin_coverage")),
        ]);
    }
    table
}
