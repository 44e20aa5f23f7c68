//! `phasmid plan --accuracy`: finds the setting that reaches an accuracy in the least time.

use crate::cli::progress::ProgressLine;
use phasmid_core::error::Result;
use phasmid_profile::{Profile, Scene};
use phasmid_report::plot::figures;
use phasmid_report::stopwatch::Stopwatch;
use phasmid_study::tradeoff::{
    LEAST_COVERAGE, MOST_GROSS, Measured, cheapest, front, measure, settings,
};
use serde::Serialize;
use std::time::Instant;

/// Maximum number of timed rounds per setting, and the time in seconds after which no further round
/// begins.
const ROUNDS: (usize, f64) = (5, 0.5);

#[derive(Serialize)]
struct Report<'a> {
    accuracy_mm: f64,
    /// The fastest setting that reaches the accuracy.
    cheapest: Option<&'a Measured>,
    settings: Vec<Line<'a>>,
    /// Settings that could not be measured, each with the reason.
    failed: &'a [String],
}

#[derive(Serialize)]
struct Line<'a> {
    #[serde(flatten)]
    measured: &'a Measured,
    /// Whether no other setting is both faster and more accurate (the setting is on the Pareto
    /// front).
    front: bool,
}

/// Reads a length such as `0.1mm`, `100um` or `0.1`, in millimetres.
pub(super) fn length_mm(text: &str) -> Result<f64, String> {
    let units = [
        ("um", 1e-3),
        ("mm", 1.0),
        ("cm", 10.0),
        ("m", 1e3),
        ("", 1.0),
    ];
    let found = units
        .into_iter()
        .find_map(|(unit, mm)| Some((text.strip_suffix(unit)?, mm)));
    let value = found.and_then(|(number, mm)| Some(number.trim().parse::<f64>().ok()? * mm));
    let positive = value.filter(|mm| (1e-9..=1e9).contains(mm));
    positive.ok_or_else(|| "expected a length such as 0.1mm or 50um".to_owned())
}

/// Measures all settings, and prints them and the fastest that reaches the accuracy.
pub(super) fn run(profile: &Profile, scene: &Scene, accuracy_mm: f64, json: bool) -> Result<()> {
    let begin = Instant::now();
    let clock = || begin.elapsed();
    let watch = Stopwatch::new(&clock);
    let wanted = settings(profile, scene);
    let progress = ProgressLine::new("settings");
    let (mut found, mut failed) = (Vec::new(), Vec::new());
    for (i, setting) in wanted.iter().enumerate() {
        progress.show(i, wanted.len());
        progress.remark(setting.to_string());
        match measure((profile, scene), setting, 1, watch, ROUNDS) {
            Ok(measured) => found.push(measured),
            // The first setting is the profile's own sequence, which must be decodable.
            Err(e) if i == 0 => return Err(e),
            Err(e) => failed.push(format!("{setting}: {e}")),
        }
    }
    drop(progress);
    let front = front(&found);
    let report = Report {
        accuracy_mm,
        cheapest: cheapest(&found, accuracy_mm),
        settings: found
            .iter()
            .zip(front)
            .map(|(measured, front)| Line { measured, front })
            .collect(),
        failed: &failed,
    };
    if json {
        let json = serde_json::to_string_pretty(&report).expect("numbers and strings");
        println!("{json}");
    } else {
        print(&report);
    }
    Ok(())
}

fn print(report: &Report<'_>) {
    println!(
        "{:<32}{:>12}{:>8}{:>10}{:>10}{:>10}{:>10}{:>9}{:>8}",
        "setting",
        "pixels",
        "frames",
        "render ms",
        "decode ms",
        "RMSE mm",
        "bound mm",
        "gross %",
        "cover %"
    );
    for Line { measured, front } in &report.settings {
        let [width, height] = measured.size_px;
        println!(
            "{:<32}{:>12}{:>8}{:>10}{:>10}{:>10}{:>10}{:>9.2}{:>8.1}{}",
            measured.setting.to_string(),
            format!("{width} x {height}"),
            measured.frames,
            figures(measured.render_ms, 3),
            figures(measured.decode_ms, 3),
            figures(measured.rmse_mm, 3),
            figures(measured.bound_mm, 3),
            100.0 * measured.gross_error_rate,
            100.0 * measured.coverage,
            if *front { " *" } else { "" }
        );
    }
    for why in report.failed {
        println!("left out: {why}");
    }
    println!(
        "\n*: no other setting is both faster and more accurate. RMSE: inliers on smooth surfaces, against \
         the truth. A setting counts if at most {} % of its points are more than 1 mm off and at least {} % of \
         the surface is covered.",
        100.0 * MOST_GROSS,
        100.0 * LEAST_COVERAGE
    );
    let wanted = figures(report.accuracy_mm, 3);
    match report.cheapest {
        Some(best) => println!(
            "\n{wanted} mm: {} ({} mm in {} ms)",
            best.setting,
            figures(best.rmse_mm, 3),
            figures(best.total_ms(), 3)
        ),
        None if report.settings.iter().any(|line| line.measured.is_sound()) => {
            println!("\n{wanted} mm: no setting reaches it");
        }
        None => println!("\n{wanted} mm: no setting covers enough of the surface"),
    }
}

#[cfg(test)]
mod tests {
    use super::length_mm;

    #[test]
    fn lengths_have_units() {
        for (text, mm) in [
            ("0.1mm", 0.1),
            ("50um", 0.05),
            ("50 um", 0.05),
            ("2", 2.0),
            ("1cm", 10.0),
        ] {
            assert!((length_mm(text).unwrap() - mm).abs() < 1e-12, "{text}");
        }
        for text in ["", "mm", "-1mm", "0", "nan", "inf", "1in", "1e99m"] {
            assert!(length_mm(text).is_err(), "{text}");
        }
    }
}
