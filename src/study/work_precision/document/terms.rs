//! Terms of image formation, each left out in turn: tables and the plot.

use super::cells::{figure, of_bound, percent, um, with_spread, words};
use crate::work_precision::row::spread;
use phasmid_report::lab::{Block, Check, Row, Section, Series, SeriesStyle, Table};
use phasmid_report::plot::figures;

pub(super) fn section(terms: &[&Row], bound_um: f64) -> Section {
    let mut errors = Table::new(
        "work-precision-terms",
        "Each term is left out of a scene that needs it (the bench in front of its torso, twelve \
         steps; without noise, except for the term noise): error of the phase relative to the full \
         plan, expressed as depth. Gross: more than 1 mm off, or a fringe where there is none.",
        &[
            "term",
            "pass",
            "RMSE um",
            "RMSE / noise bound, %",
            "gross, %",
            "lost, %",
        ],
    );
    let mut times = Table::new(
        "work-precision-term-times",
        "Nanoseconds per pixel of a scan (geometry and twelve frames) on all threads, median \
         (quartiles) of alternating runs.",
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
        "Benefit and cost of each term. Uniform factors, such as vignetting and ambient light, \
         change only the brightness, not the phase: their error here is almost zero, whatever they \
         do to the noise. Nonlinear responses of projector and camera add harmonics, of which \
         twelve steps cancel all up to the tenth. Three terms change no byte here: blooming needs \
         light beyond the full well, which this scene does not have; the light source of a \
         sequence that was never started has not warmed up, so its timing is exact; and no pattern \
         varies along y. The error due to noise is {} times the bound of its own pixels, which is \
         lower than that of the scans above, because the torso is brighter in the middle of the \
         image and the converter has 16 bits. The footprint along the fringes' axis cannot be left \
         out of a plan whose pattern images vary along it: the section on frames compares it with \
         samples. Shadows matter where light falls that should not, which the phase of lit pixels \
         does not show.",
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
        "Error without a term against the time that leaving it out saves. Terms that cost nothing \
         or change nothing are off the axes.",
        [
            "time saved without the term, ns per pixel of a scan",
            "RMSE without the term, mm",
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
                    "error due to noise / bound of the same pixels, difference from 1",
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
