//! Prints the results as tables.

use super::Report;
use super::measure::Rate;

pub(super) fn print(report: &Report<'_>) {
    println!(
        "{} looking at {}: {} x {} pixels, {} triangles, {}, {} samples a pixel, {} threads",
        report.profile,
        report.scene,
        report.width,
        report.height,
        report.triangles,
        report.sequence,
        report.samples,
        report.threads
    );
    for adapter in report.runs.iter().filter_map(|run| run.adapter.as_ref()) {
        println!(
            "gpu: {} ({}), {}",
            adapter.name, adapter.kind, adapter.driver
        );
    }
    if let Some(why) = &report.without_gpu {
        println!("no gpu: {why}");
    }
    println!(
        "\n{:<8}{:>16}{:>12}{:>16}{:>12}",
        "", "still frames/s", "x copy", "moving frames/s", "x copy"
    );
    for run in &report.runs {
        let cells = |rate: &Rate| format!("{:>16.1}{:>12.1}", rate.frames_per_s, rate.over_copy);
        println!(
            "{:<8}{}{}",
            run.backend,
            cells(&run.still),
            cells(&run.moving)
        );
    }
    println!("\n{:<8}{:<28}{:>8}{:>12}", "", "pass", "runs", "us a frame");
    for run in &report.runs {
        for row in &run.passes {
            println!(
                "{:<8}{:<28}{:>8.1}{:>12.1}",
                run.backend, row.pass, row.runs_per_frame, row.us_per_frame
            );
        }
        if run.passes.is_empty() {
            println!(
                "{:<8}this adapter has no timestamps for passes",
                run.backend
            );
        }
    }
    println!(
        "\nmoving: with the geometry pass in every frame, as are the passes' times; x copy: over a \
         memory copy of a frame's bytes, {:.1} us.",
        report.copy_us
    );
}
