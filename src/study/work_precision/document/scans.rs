//! Scans with noise: machine-independent results (errors by steps and resolution, and the least work
//! for an accuracy, counted in exposed and read pixels), the fastest setting for an accuracy, and the
//! plot.

use super::cells::{figure, front, percent, um, with_spread, words};
use crate::work_precision::row::spread;
use phasmid_report::lab::{
    Block, Check, Figure, Row, Section, Series, SeriesStyle, Settings, Table,
};
use phasmid_report::plot::figures;

/// Accuracies for which a setting is named, in millimetres.
const WANTED_MM: [f64; 4] = [0.1, 0.05, 0.02, 0.01];
/// Minimum fraction of the surface that a sound setting measures.
const LEAST_COVERAGE: f64 = 0.9;
/// Maximum fraction of gross errors of a sound setting.
const MOST_GROSS: f64 = 0.01;
/// Returns steps, resolution and samples as texts.
fn scan_name(row: &Row) -> [String; 3] {
    [
        row.get("steps").to_owned(),
        format!("{} x {}", row.get("width"), row.get("height")),
        row.get("samples").to_owned(),
    ]
}

fn scan_s(row: &Row) -> f64 {
    row.value("render_s") + row.value("decode_s")
}

pub(super) fn section(scans: &[&Row], settings: &Settings) -> Section {
    let mut errors = Table::new(
        "work-precision-scans",
        "Scans of the trapezoid with noise: depth error on smooth surfaces against the f64 truth. \
         Gross: more than 1 mm off; beyond 5 sigma: off by more than 5 standard deviations as stated \
         by the decoder.",
        &[
            "steps",
            "pixels",
            "samples",
            "frames",
            "inlier RMSE, um",
            "bound, um",
            "RMSE / bound",
            "held pixels, um",
            "RMSE / bound, held pixels removed",
            "gross, %",
            "beyond 5 sigma, %",
            "coverage, %",
            "edges, RMSE um",
        ],
    );
    let mut times = Table::new(
        "work-precision-scan-times",
        "The same scans: milliseconds, median (quartiles) of repeated runs. Rendering is the \
         geometry pass and all frames. * marks the Pareto front of the sum, among settings with at \
         most 1 % of gross errors and at least 90 % of the surface.",
        &[
            "steps",
            "pixels",
            "samples",
            "render, ms",
            "decode, ms",
            "sum, ms",
            "",
        ],
    )
    .timed();
    let places: Vec<[f64; 2]> = scans
        .iter()
        .map(|row| match is_sound(row) {
            true => [scan_s(row), row.value("inlier_rmse_mm")],
            false => [f64::NAN; 2],
        })
        .collect();
    let best = front(&places);
    for (row, best) in scans.iter().zip(&best) {
        let [steps, pixels, samples] = scan_name(row);
        errors.row([
            steps.clone(),
            pixels.clone(),
            samples.clone(),
            row.get("frames").to_owned(),
            um(row.value("inlier_rmse_mm")),
            um(row.value("bound_mm")),
            figures(row.value("ratio_to_bound"), 3),
            um(row.value("held_mm")),
            figures(row.value("ratio_less_held"), 3),
            percent(row.value("gross")),
            percent(row.value("beyond_5_sigma")),
            percent(row.value("coverage")),
            um(row.value("crease_rmse_mm")),
        ]);
        times.row([
            steps,
            pixels,
            samples,
            with_spread(spread(row, "render_s").times(1e3), 3),
            with_spread(spread(row, "decode_s").times(1e3), 3),
            figures(scan_s(row) * 1e3, 3),
            if *best { "*" } else { "" }.to_owned(),
        ]);
    }
    let about = "Error and time of scans with different numbers of steps, resolutions and samples \
                 per pixel. Pixels that are half as wide see half as much of a fringe at once, so \
                 that its contrast is higher; all are exposed until they have the same light. The \
                 fringes are 16 projector pixels wide, of which a pixel of the bench spans 4.35: \
                 at half its resolution, more than half a fringe falls into one pixel. The error \
                 above the noise bound is the same for every number of steps. It comes from the \
                 projector's held pixels: they create images of the fringe, which turn with the \
                 step as the fringe does. A pixel averages over 4.35 projector pixels on floor and \
                 top, which reduces these images to some thousandths; only a whole number would \
                 leave nothing. The closed form of each pixel's footprint gives this error (held \
                 pixels). Subtracted pixel by pixel, it leaves the bound.";
    Section::new(
        "Scans",
        vec![
            words(about),
            Block::Table(errors),
            Block::Table(by_steps(scans)),
            Block::Table(least(scans)),
            Block::Table(times),
            Block::Table(cheapest(scans)),
            Block::Figure(scan_figure(scans, &best)),
            Block::Checks(scan_checks(scans, settings)),
        ],
    )
}

/// Returns whether a setting covers enough of the surface with few gross errors.
fn is_sound(row: &Row) -> bool {
    row.value("coverage") >= LEAST_COVERAGE && row.value("gross") <= MOST_GROSS
}

/// Returns whether a sound setting reaches an accuracy.
fn fits(row: &Row, wanted_mm: f64) -> bool {
    row.value("inlier_rmse_mm") <= wanted_mm && is_sound(row)
}

/// Tabulates the least work, which is independent of the machine.
fn least(scans: &[&Row]) -> Table {
    let caption = format!(
        "Setting with the fewest pixels in all frames together for each wanted accuracy, among \
         settings with at most {} % of gross errors and at least {} % of the surface.",
        MOST_GROSS * 100.0,
        LEAST_COVERAGE * 100.0
    );
    least_work(scans, &WANTED_MM, caption, fits)
}

/// Tabulates the fastest setting for each wanted accuracy.
fn cheapest(scans: &[&Row]) -> Table {
    let mut table = Table::new(
        "work-precision-cheapest",
        format!(
            "Fastest setting for each wanted accuracy, among those with at most {} % of gross \
             errors and at least {} % of the surface.",
            MOST_GROSS * 100.0,
            LEAST_COVERAGE * 100.0
        ),
        &[
            "wanted, mm",
            "steps",
            "pixels",
            "samples",
            "inlier RMSE, um",
            "sum, ms",
        ],
    )
    .timed();
    for wanted in WANTED_MM {
        let time = |a: &&&Row, b: &&&Row| scan_s(a).total_cmp(&scan_s(b));
        let cells = match scans.iter().filter(|row| fits(row, wanted)).min_by(time) {
            Some(row) => {
                let [steps, pixels, samples] = scan_name(row);
                let error = um(row.value("inlier_rmse_mm"));
                [steps, pixels, samples, error, figures(scan_s(row) * 1e3, 3)]
            }
            None => ["none", "", "", "", ""].map(str::to_owned),
        };
        table.row(std::iter::once(wanted.to_string()).chain(cells));
    }
    table
}

fn scan_figure(all: &[&Row], best: &[bool]) -> Figure {
    let point = |row: &Row| (scan_s(row) * 1e3, row.value("inlier_rmse_mm"));
    let mut scales: Vec<&str> = Vec::new();
    for row in all {
        if !scales.contains(&row.get("scale")) {
            scales.push(row.get("scale"));
        }
    }
    // Draw settings that cannot be on the Pareto front as a separate series.
    let (scans, unsound): (Vec<&Row>, Vec<&Row>) = all.iter().partition(|row| is_sound(row));
    let scans = scans.as_slice();
    let single = |row: &&&Row| row.get("samples") == "1";
    let mut series: Vec<Series> = scales
        .iter()
        .map(|scale| {
            let of = || {
                scans
                    .iter()
                    .filter(single)
                    .filter(|r| r.get("scale") == *scale)
            };
            let mut one = Series::new(
                &format!("{scale} x the pixels per side"),
                SeriesStyle::Both,
                of().map(|row| point(row)),
            );
            one.tips = of()
                .map(|row| format!("{} steps", row.get("steps")))
                .collect();
            one
        })
        .collect();
    let sampled = || scans.iter().filter(|row| row.get("samples") != "1");
    let mut more = Series::new(
        "4, 16, 64 samples",
        SeriesStyle::Dots,
        sampled().map(|row| point(row)),
    );
    more.tips = sampled()
        .map(|row| format!("{} samples", row.get("samples")))
        .collect();
    series.push(more);
    let bound = |row: &&&Row| row.get("scale") == "1" && row.get("samples") == "1";
    let bounds = scans.iter().filter(bound);
    let bounds = bounds.map(|row| (scan_s(row) * 1e3, row.value("bound_mm")));
    series.push(Series::new(
        "noise bound at 1 x",
        SeriesStyle::Dashed,
        bounds,
    ));
    let on = all.iter().zip(best).filter(|(_, best)| **best);
    let mut on: Vec<(f64, f64)> = on.map(|(row, _)| point(row)).collect();
    on.sort_by(|a, b| a.0.total_cmp(&b.0));
    series.push(Series::new("Pareto front", SeriesStyle::Dashed, on));
    let mut out = Series::new(
        "excluded: gross or few points",
        SeriesStyle::Rings,
        unsound.iter().map(|row| point(row)),
    );
    out.tips = unsound
        .iter()
        .map(|row| scan_name(row).join(", "))
        .collect();
    series.push(out);
    figure(
        "work-precision-scans",
        "Error of scans with noise against the time to render and decode them. Excluded from the front are \
         settings with more than 1 % of gross errors or less than 90 % of the surface.",
        ["time of a scan, ms", "inlier RMSE, mm"],
        series,
    )
}

/// Checks that doubling the steps reduces the error by sqrt(2), within a tenth. Also checks that,
/// without the correction of held pixels, the errors minus the closed form of held pixels are pure
/// noise: the standard deviation of their ratio to the bound is 1 / sqrt(2 pixels), half a hundredth in
/// the quick form.
fn scan_checks(scans: &[&Row], settings: &Settings) -> Vec<Check> {
    let error = |steps: f64| {
        let found = scans.iter().find(|row| {
            row.value("steps") == steps && row.get("scale") == "1" && row.get("samples") == "1"
        });
        found.map_or(f64::NAN, |row| row.value("inlier_rmse_mm"))
    };
    let most: f64 = if settings.quick { 24.0 } else { 48.0 };
    let off = error(most) / error(12.0) * (most / 12.0).sqrt() - 1.0;
    let what = format!(
        "error of {most} steps / (error of 12 steps * sqrt(12 / {most})), difference from 1"
    );
    let less_held = |steps: f64| {
        let found = scans.iter().find(|row| {
            row.value("steps") == steps && row.get("scale") == "1" && row.get("samples") == "1"
        });
        let ratio = found.map_or(f64::NAN, |row| row.value("ratio_less_held"));
        let what = format!("error of {steps} steps without held pixels / bound, difference from 1");
        Check::at_most(what, (ratio - 1.0).abs(), 0.02)
    };
    vec![
        Check::at_most(what, off.abs(), 0.1),
        less_held(12.0),
        less_held(most),
    ]
}

/// Tabulates settings by steps and resolution, with one sample per pixel.
fn by_steps(scans: &[&Row]) -> Table {
    let single = || scans.iter().filter(|row| row.get("samples") == "1");
    let distinct = |name: &str| {
        let mut found: Vec<&str> = Vec::new();
        for row in single() {
            if !found.contains(&row.get(name)) {
                found.push(row.get(name));
            }
        }
        found
    };
    let (steps, scales) = (distinct("steps"), distinct("scale"));
    let size = |scale: &&str| {
        let row = single().find(|row| row.get("scale") == *scale);
        row.map_or_else(String::new, |row| {
            format!("{} x {}", row.get("width"), row.get("height"))
        })
    };
    let header: Vec<String> = std::iter::once("steps".to_owned())
        .chain(scales.iter().map(size))
        .collect();
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let mut table = Table::new(
        "work-precision-steps",
        "Inlier RMSE in micrometres for the same field, by steps and resolution.",
        &header,
    );
    for steps in &steps {
        let cells = scales.iter().map(|scale| {
            let same = |row: &&&Row| row.get("steps") == *steps && row.get("scale") == *scale;
            let row = single().find(same);
            row.map_or_else(String::new, |row| um(row.value("inlier_rmse_mm")))
        });
        table.row(std::iter::once((*steps).to_owned()).chain(cells));
    }
    table
}

/// Returns the megapixels of all frames of a scan.
fn megapixels(row: &Row) -> f64 {
    row.value("frames") * row.value("width") * row.value("height") * 1e-6
}

/// Tabulates for each wanted accuracy the setting that `fits` with the fewest pixels, and among these
/// with the fewest frames.
fn least_work(
    scans: &[&Row],
    wanted_mm: &[f64],
    caption: String,
    fits: impl Fn(&Row, f64) -> bool,
) -> Table {
    let mut table = Table::new(
        "work-precision-least",
        caption,
        &[
            "wanted, mm",
            "steps",
            "pixels",
            "frames",
            "total Mpixel",
            "inlier RMSE, um",
        ],
    );
    for &wanted in wanted_mm {
        // Exclude settings with more samples per pixel: they are more work for the same number of
        // pixels.
        let fitting = scans
            .iter()
            .filter(|row| row.get("samples") == "1" && fits(row, wanted));
        let work = |row: &&&Row| [megapixels(row), row.value("frames")];
        let least = fitting.min_by(|a, b| {
            let ([a, m], [b, n]) = (work(a), work(b));
            a.total_cmp(&b).then(m.total_cmp(&n))
        });
        let cells = match least {
            Some(row) => [
                row.get("steps").to_owned(),
                format!("{} x {}", row.get("width"), row.get("height")),
                row.get("frames").to_owned(),
                figures(megapixels(row), 3),
                um(row.value("inlier_rmse_mm")),
            ],
            None => ["none", "", "", "", ""].map(str::to_owned),
        };
        table.row(std::iter::once(wanted.to_string()).chain(cells));
    }
    table
}
