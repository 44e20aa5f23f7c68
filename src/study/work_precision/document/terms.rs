//! Terms of image formation, each left out in turn: tables and the plot.

use super::cells::{figure, of_bound, percent, um, with_spread, words};
use crate::work_precision::row::spread;
use phasmid_report::lab::{Block, Check, Row, Section, Series, SeriesStyle, Table};
use phasmid_report::plot::figures;

pub(super) fn section(terms: &[&Row], bound_um: f64) -> Section {
    let mut errors = Table::new(
        "work-precision-terms",
        "Each term left out of a scene that needs it (the bench before its torso, twelve steps, \
         otherwise without noise): error of the phase against the full plan, as depth; gross: more \
         than 1 mm off, or a fringe where there is none.",
        &[
            "term",
            "pass",
            "RMSE um",
            "of noise bound, %",
            "gross, %",
            "lost, %",
        ],
    );
    let mut times = Table::new(
        "work-precision-term-times",
        "Nanoseconds a pixel of a scan (geometry and twelve frames) on all threads, median (quartiles) \
         of runs in turns.",
        &["term", "with", "without", "saved"],
    )
    .timed();
    for row in terms {
        let name = row.get("setting").to_owned();
        errors.row([
            name.clone(),
            row.get("pass").to_owned(),
            um(row.value("inlier_rmse_mm")),
            of_bound(row, bound_um),
            percent(row.value("gross")),
            percent(1.0 - row.value("coverage")),
        ]);
        let [with, without] = ["ns", "without_ns"].map(|name| spread(row, name));
        times.row([
            name,
            with_spread(with, 3),
            with_spread(without, 3),
            figures(with.median - without.median, 3),
        ]);
    }
    let value_of = |name: &str, column: &str| {
        let row = terms.iter().find(|row| row.get("setting") == name);
        row.map_or(f64::NAN, |row| row.value(column))
    };
    let of_noise = value_of("noise", "ratio_to_bound");
    let about = format!(
        "What each term is worth and what it costs. Uniform factors, such as vignetting and ambient \
         light, leave the phase alone and change the light only: their error is next to none here, \
         whatever they do to the noise. Bent responses of projector and camera make harmonics, of \
         which twelve steps cancel all up to the tenth. Blooming needs light beyond the full well, \
         which this scene has not; the light source of a sequence that was never started has not \
         warmed up, and so keeps time; no pattern varies along y: these terms change no byte. Noise is \
         worth {} times its own pixels' bound, which here is less than that of the scans above: the \
         torso is brighter in the middle of the image, and the converter has 16 bits. The footprint \
         along the fringes' axis cannot be left out of a plan whose slides vary along it: the frames \
         above compare it with samples. Shadows count where light falls that should not, which the \
         phase of lit pixels does not show.",
        figures(of_noise, 3)
    );
    let of = |pass: &'static str| {
        let dots = terms.iter().copied().filter(|row| row.get("pass") == pass);
        let dots: Vec<&Row> = dots.collect();
        if dots.is_empty() {
            return None;
        }
        let place = |row: &&Row| (saved(row), row.value("inlier_rmse_mm"));
        let mut series = Series::new(pass, SeriesStyle::Dots, dots.iter().map(place));
        series.tips = dots
            .iter()
            .map(|row| row.get("setting").to_owned())
            .collect();
        series.labelled = true;
        Some(series)
    };
    let series = ["geometry", "exposure", "sensor"]
        .into_iter()
        .filter_map(of);
    let plot = figure(
        "work-precision-terms",
        "Error without a term against the time that it takes; terms that cost or change nothing are \
         off the axes.",
        [
            "time that leaving it out saves, ns a pixel of a scan",
            "RMSE without it, mm",
        ],
        series.collect(),
    );
    Section::new(
        "Terms",
        vec![
            words(&about),
            Block::Table(errors),
            Block::Table(times),
            Block::Figure(plot),
            Block::Checks(vec![
                Check::at_most(
                    "error of leaving out a term that is not needed, mm",
                    value_of("footprint-y", "inlier_rmse_mm"),
                    0.0,
                ),
                Check::at_most(
                    "error of noise over its own pixels' bound, off 1",
                    (of_noise - 1.0).abs(),
                    0.03,
                ),
            ]),
        ],
    )
}

fn saved(row: &Row) -> f64 {
    row.value("ns") - row.value("without_ns")
}
