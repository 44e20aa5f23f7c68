//! Position errors and Dice's coefficients in the form of the paper's tables 4 and 5.

use super::paired::{Spread, difference, values};
use phasmid_report::lab::{Block, Chart, Check, Figure, Rows, Series, SeriesStyle, Table};
use phasmid_report::plot::figures;

/// Maximum ratio of the error to its stated standard deviation (RMS); generous, because two
/// patients are a small sample.
const MOST_OVER_DEVIATION: f64 = 2.0;

/// Published means over fifteen patients of the target position error in millimetres: with the ideal
/// skin, with the ideal skin and Gaussian noise of 0.5 mm, and with the skin of the paper's virtual
/// scanner (Wu et al., "Virtual 3D surface imaging system for the validation of tumor tracking
/// algorithm used in surface-guided radiotherapy", tables 4 and 5).
const PUBLISHED_POSITION_MM: [f64; 3] = [1.29, 1.33, 1.57];
/// Published means of Dice's coefficient, in the order of [`PUBLISHED_POSITION_MM`].
const PUBLISHED_DICE: [f64; 3] = [0.924, 0.920, 0.906];

/// The three columns of the paper.
const INPUTS: [&str; 3] = ["ideal", "noisy", "scanned"];

pub(super) fn blocks(rows: &Rows, patients: &[&str]) -> Vec<Block> {
    vec![
        Block::Table(table(
            rows,
            patients,
            ("sgrt-position", "tpe_mm"),
            (PUBLISHED_POSITION_MM, 2),
            "Target position error in mm: distance between the centroids of the tracked and the \
             true tumour, mean and standard deviation over the moments of each patient. The last \
             rows are the mean and standard deviation over the patients' means, and the paper's \
             means.",
        )),
        Block::Table(table(
            rows,
            patients,
            ("sgrt-dice", "dice"),
            (PUBLISHED_DICE, 3),
            "Dice's coefficient of the tracked and the true tumour, mean and standard deviation over \
             the moments of each patient, then over the patients' means.",
        )),
        Block::Table(simulated(rows, patients)),
        Block::Figure(figure(rows, patients)),
        Block::Checks(checks(rows, patients)),
    ]
}

/// Formats a mean with its standard deviation.
fn with_spread(spread: Spread) -> String {
    match spread.deviation.is_finite() {
        true => format!("{:.3} ± {:.3}", spread.mean, spread.deviation),
        false => figures(spread.mean, 3),
    }
}

/// Returns a patient's mean over the moments that have a result.
fn of_patient(rows: &Rows, input: &str, patient: &str, column: &str) -> Spread {
    let mut all = values(rows, input, patient, column);
    all.retain(|v| v.is_finite());
    Spread::of(&all)
}

fn over_patients(rows: &Rows, input: &str, patients: &[&str], column: &str) -> Spread {
    let means = patients.iter();
    let means = means.map(|p| of_patient(rows, input, p, column).mean);
    let means: Vec<f64> = means.filter(|m| m.is_finite()).collect();
    Spread::of(&means)
}

fn table(
    rows: &Rows,
    patients: &[&str],
    (name, column): (&str, &str),
    (paper, decimals): ([f64; 3], usize),
    caption: &str,
) -> Table {
    let header = ["patient", "ideal skin", "with 0.5 mm noise", "as scanned"];
    let mut table = Table::new(name, caption, &header);
    for patient in patients {
        let cells = INPUTS.map(|input| with_spread(of_patient(rows, input, patient, column)));
        table.row([vec![(*patient).to_owned()], cells.into()].concat());
    }
    let all = INPUTS.map(|input| with_spread(over_patients(rows, input, patients, column)));
    table.row([vec!["all".to_owned()], all.into()].concat());
    let paper = paper.map(|v| format!("{v:.decimals$}"));
    table.row([vec!["paper".to_owned()], paper.into()].concat());
    table
}

/// Tabulates the scanner's effect on position error and Dice's coefficient, from pairs of inputs.
fn simulated(rows: &Rows, patients: &[&str]) -> Table {
    let mut table = Table::new(
        "sgrt-paired",
        "Result with the scanned skin minus that with the ideal skin at the same moment: mean over \
         the patients with its 95 % confidence interval (Student's, over the patients' means).",
        &["quantity", "scanned minus ideal", "95 % interval", "paper"],
    );
    let cases = [
        ("position error in mm", "tpe_mm", PUBLISHED_POSITION_MM),
        ("Dice's coefficient", "dice", PUBLISHED_DICE),
    ];
    for (name, column, paper) in cases {
        let found = difference(rows, patients, [("scanned", column), ("ideal", column)]);
        table.row([
            name.to_owned(),
            format!("{:+.3}", found.mean),
            interval(found),
            format!("{:+.3}", paper[2] - paper[0]),
        ]);
    }
    table
}

/// Formats a confidence interval.
pub(super) fn interval(spread: Spread) -> String {
    match spread.half.is_finite() {
        true => format!(
            "{:+.3} to {:+.3}",
            spread.mean - spread.half,
            spread.mean + spread.half
        ),
        false => "-".to_owned(),
    }
}

/// Plots the position error over the tumour's distance from its planned position.
fn figure(rows: &Rows, patients: &[&str]) -> Figure {
    let series = INPUTS.map(|input| {
        let points = patients.iter().flat_map(|patient| {
            let [x, y] = ["moved_mm", "tpe_mm"].map(|c| values(rows, input, patient, c));
            x.into_iter().zip(y).collect::<Vec<_>>()
        });
        Series::new(input, SeriesStyle::Dots, points)
    });
    let chart = Chart {
        heading: "Position error against the displacement of the tumour".to_owned(),
        x: "distance of the tumour from its planned position (mm)".to_owned(),
        y: "position error (mm)".to_owned(),
        log: [false, false],
        series: series.into(),
    };
    chart.figure(
        "sgrt-position",
        "Each moment of each patient: error of the tracked position against the true distance of \
                  the tumour from its planned position.",
    )
}

/// Returns the RMS ratio of error to stated standard deviation over all moments.
fn over_deviation(rows: &Rows) -> f64 {
    let of = rows.with("input", "scanned");
    let ratios: Vec<f64> = of
        .map(|row| row.value("tpe_mm") / row.value("deviation_mm"))
        .collect();
    (ratios.iter().map(|ratio| ratio * ratio).sum::<f64>() / ratios.len() as f64).sqrt()
}

/// Checks that our tracker with our scanner has no larger errors than the tracker of Wu et al. with
/// their scanner.
fn checks(rows: &Rows, patients: &[&str]) -> Vec<Check> {
    let position = over_patients(rows, "scanned", patients, "tpe_mm").mean;
    let dice = over_patients(rows, "scanned", patients, "dice").mean;
    let lost = rows.with("input", "scanned");
    let lost = lost.filter(|row| !row.value("tpe_mm").is_finite()).count();
    vec![
        Check::at_most(
            "mean position error with scanned skin, in mm",
            position,
            PUBLISHED_POSITION_MM[2],
        ),
        Check::at_most(
            "1 minus the mean Dice's coefficient with scanned skin",
            1.0 - dice,
            1.0 - PUBLISHED_DICE[2],
        ),
        Check::at_most("scans without a result", lost as f64, 0.0),
        Check::at_most(
            "RMS of position error / stated standard deviation, with scanned skin",
            over_deviation(rows),
            MOST_OVER_DEVIATION,
        ),
    ]
}
