//! Frames of the CPU and of the GPU compared with the reference path: tables, and a common plot.

use super::cells::{figure, front, of_bound, percent, um, with_spread, words};
use crate::work_precision::row::spread;
use phasmid_report::lab::{Block, Check, Figure, Row, Section, Series, SeriesStyle, Table};
use phasmid_report::plot::figures;

/// Maximum error of the fast path, as a fraction of the noise bound.
const MOST_OF_BOUND: f64 = 0.1;

fn frame_name(row: &Row) -> [String; 2] {
    [row.get("setting").to_owned(), row.get("samples").to_owned()]
}

/// Returns the sections of the CPU's and the GPU's frames, with a common Pareto front and plot.
pub(super) fn sections(frames: &[&Row], gpu: &[&Row], bound_um: f64) -> [Section; 2] {
    let there: Vec<&Row> = gpu
        .iter()
        .copied()
        .filter(|row| row.get("note").is_empty())
        .collect();
    let all: Vec<&Row> = frames.iter().chain(&there).copied().collect();
    let place = |row: &&Row| [row.value("ns"), row.value("inlier_rmse_mm")];
    let best = front(&all.iter().map(place).collect::<Vec<_>>());
    let plot = plot(&all, &best);
    let (of_processor, of_gpu) = best.split_at(frames.len());
    let processor = processor(frames, of_processor, plot, bound_um);
    [processor, of_adapter(gpu, of_gpu, bound_um)]
}

fn processor(frames: &[&Row], best: &[bool], plot: Figure, bound_um: f64) -> Section {
    let mut errors = Table::new(
        "work-precision-frames",
        "Frames without noise compared with the reference path (f64, thousands of rays per pixel): \
         error of the phase from four steps, expressed as depth.",
        &[
            "filter",
            "rays",
            "smooth, RMSE um",
            "RMSE / noise bound, %",
            "grey levels, RMS",
            "edges, RMSE um",
            "edges, gross %",
        ],
    );
    let mut times = Table::new(
        "work-precision-frame-times",
        "Nanoseconds per pixel of a frame on all threads, median (quartiles), including the \
         geometry that four frames share. * marks the Pareto front, which includes the GPU's \
         frames if there is a GPU.",
        &["filter", "rays", "ns/px", ""],
    )
    .timed();
    for (row, best) in frames.iter().zip(best) {
        let [filter, rays] = frame_name(row);
        let edges = row.value("crease_rmse_mm");
        errors.row([
            filter.clone(),
            rays.clone(),
            um(row.value("inlier_rmse_mm")),
            of_bound(row, bound_um),
            figures(row.value("levels"), 3),
            um(edges),
            // The closed form in f64 is not evaluated at edges, so it has no gross errors there.
            percent(if edges.is_nan() {
                f64::NAN
            } else {
                row.value("gross")
            }),
        ]);
        if row.value("ns").is_nan() {
            continue;
        }
        let mark = if *best { "*" } else { "" };
        times.row([
            filter,
            rays,
            with_spread(spread(row, "ns"), 3),
            mark.to_owned(),
        ]);
    }
    let about = "Compares the closed form of a pixel's footprint with sampling, and f32 with f64. \
                 The reference looks up one held pixel of the pattern image per ray. Its error \
                 falls with the number of rays, and all settings are compared with the largest \
                 number: an error below that of a quarter of the rays, in the last row, cannot be \
                 trusted. The closed form in f64 uses the fast path's formula with negligible \
                 rounding; the row that compares the two shows what f32 costs. More samples per \
                 pixel change nothing on smooth surfaces, where the closed form replaces them; \
                 edges have sixteen rays even if fewer are set, and gain from sixty-four. Sampling \
                 in f64 is the reference path itself, which tests every ray against every surface: \
                 its times are not typical of a renderer, but their growth with the number of rays \
                 is.";
    let fast = frames
        .iter()
        .find(|row| frame_name(row) == ["closed form, f32".to_owned(), "1".to_owned()]);
    let share = fast.map_or(f64::NAN, |row| row.value("inlier_rmse_mm") * 1e3 / bound_um);
    // The bound comes from the scans, if these were made.
    let check = bound_um.is_finite().then(|| {
        Check::at_most(
            "fast path's error over the noise bound of 12 steps",
            share,
            MOST_OF_BOUND,
        )
    });
    Section::new(
        "Frames",
        vec![
            words(about),
            Block::Table(errors),
            Block::Table(times),
            Block::Figure(plot),
            Block::Checks(check.into_iter().collect()),
        ],
    )
}

/// Plots all frames by time and error, and the Pareto front.
fn plot(all: &[&Row], best: &[bool]) -> Figure {
    let point = |row: &Row| (row.value("ns"), row.value("inlier_rmse_mm"));
    let by = |name: &str, style: SeriesStyle, is: &dyn Fn(&Row) -> bool| {
        let of = || all.iter().filter(|row| is(row));
        let mut series = Series::new(name, style, of().map(|row| point(row)));
        series.tips = of()
            .map(|row| format!("{} rays", row.get("samples")))
            .collect();
        series
    };
    let of_gpu = |row: &Row| row.get("group") == "gpu";
    let mut series: Vec<Series> = [
        ("closed form, f32", SeriesStyle::Both),
        ("closed form, f64", SeriesStyle::Dots),
        ("sampled, f64", SeriesStyle::Both),
    ]
    .map(|(name, style)| {
        by(name, style, &|row| {
            !of_gpu(row) && row.get("setting") == name
        })
    })
    .into();
    if all.iter().any(|row| of_gpu(row)) {
        series.push(by("closed form, f32, GPU", SeriesStyle::Both, &of_gpu));
    }
    let on = all.iter().zip(best).filter(|(_, best)| **best);
    let mut on: Vec<(f64, f64)> = on.map(|(row, _)| point(row)).collect();
    on.sort_by(|a, b| a.0.total_cmp(&b.0));
    series.push(Series::new("Pareto front", SeriesStyle::Dashed, on));
    figure(
        "work-precision-frames",
        "Error of frames without noise, on smooth surfaces, against time.",
        ["time per pixel of a frame, ns", "RMSE, mm"],
        series,
    )
}

/// Tabulates the GPU's frames in a table of times, because they depend on the adapter.
fn of_adapter(gpu: &[&Row], best: &[bool], bound_um: f64) -> Section {
    let mut table = Table::new(
        "work-precision-gpu",
        "The same frames on the GPU, timed from the request of a frame to its bytes. * marks the \
         Pareto front of these and the CPU's frames.",
        &[
            "adapter",
            "rays",
            "smooth, RMSE um",
            "RMSE / noise bound, %",
            "edges, RMSE um",
            "ns/px",
            "",
        ],
    )
    .timed();
    let mut blocks = Vec::new();
    // Rows without measured values are not on the Pareto front.
    let mut best = best.iter();
    for row in gpu {
        if !row.get("note").is_empty() {
            let why = format!("The GPU's rows are left out: {}.", row.get("note"));
            blocks.push(Block::Words(why));
            continue;
        }
        table.row([
            row.get("adapter").to_owned(),
            row.get("samples").to_owned(),
            um(row.value("inlier_rmse_mm")),
            of_bound(row, bound_um),
            um(row.value("crease_rmse_mm")),
            with_spread(spread(row, "ns"), 3),
            match best.next() {
                Some(true) => "*",
                _ => "",
            }
            .to_owned(),
        ]);
    }
    if !table.rows.is_empty() {
        blocks.push(Block::Table(table));
    }
    Section::new("CPU and GPU", blocks)
}
