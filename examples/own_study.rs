//! A study in one file: does the error of a scan stay at its theoretical bound when light is scarce?
//! `cargo run --release --example own_study -- study light --out light` runs it.

use phasmid::cli::{self, Launcher};
use phasmid::profile::{Profile, Scene};
use phasmid::study::{lab::*, scanned};
use phasmid::{Result, emulator::render::Options};

struct Light;

impl Study for Light {
    fn name(&self) -> &'static str {
        "light"
    }
    fn about(&self) -> &'static str {
        "Does the error of a scan stay at its bound when light is scarce?"
    }
    fn columns(&self) -> &'static [&'static str] {
        &["light", "error_mm", "bound_mm", "ratio"]
    }
    fn trials(&self, settings: &Settings) -> Result<Vec<Trial>> {
        let count = if settings.quick { 2 } else { 5 };
        let trial = |i| {
            let light = 0.5_f64.powi(i);
            let work = move |context: &Context<'_>| scan(context, light);
            Trial::new(format!("light={light}"), settings.seed, work)
        };
        Ok((0..count).map(trial).collect())
    }
    fn sections(&self, rows: &Rows, _: &Folder, _: &Settings) -> Result<Vec<Section>> {
        let line = |name, column| {
            let point = |row: &Row| (row.value("light"), row.value(column));
            Series::new(name, SeriesStyle::Both, rows.all.iter().map(point))
        };
        let chart = Chart {
            heading: "A sphere in front of webcam-grey".to_owned(),
            x: "light, fraction of the profile's".to_owned(),
            y: "RMS error of depth, mm".to_owned(),
            log: [true; 2],
            series: vec![line("error", "error_mm"), line("bound", "bound_mm")],
        };
        let columns = [
            ("light", "light", 0),
            ("error, mm", "error_mm", 3),
            ("over bound", "ratio", 3),
        ];
        let table = Table::of("light", "RMS error of depth", &rows.all, &columns);
        let ratios = rows.all.iter().map(|row| row.value("ratio"));
        let worst = ratios.fold(f64::NAN, f64::max);
        let blocks = vec![
            Block::Table(table),
            Block::Figure(chart.figure("light", "Error and bound by light")),
            Block::Checks(vec![Check::at_most("error over its bound", worst, 1.5)]),
        ];
        Ok(vec![Section::new("Light", blocks)])
    }
}

/// A trial: one scan, one row.
fn scan(context: &Context<'_>, light: f64) -> Result<Vec<Row>> {
    let mut profile = Profile::load("webcam-grey")?;
    profile.projector.radiant_intensity_w_sr *= light;
    let (scene, options) = (Scene::load("sphere")?, Options::default());
    let mut stage = scanned::Stage::new(&profile, &scene, context.seed, options)?;
    let (_, score) = scanned::scored(&stage.scan(0)?, &stage.truth())?;
    let row = Row::new()
        .number("light", light)
        .number("ratio", score.ratio_to_bound);
    let row = row.number("error_mm", score.inlier_rmse_mm);
    Ok(vec![row.number("bound_mm", score.bound_mm)])
}

fn main() -> std::process::ExitCode {
    let launcher = Launcher {
        program: None,
        studies: &[&Light],
    };
    cli::main(std::env::args_os(), &launcher).into()
}

#[cfg(test)]
mod tests {
    #[test]
    fn runs() {
        let launcher = super::Launcher {
            studies: &[&super::Light],
            ..Default::default()
        };
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("light");
        let out = out.to_str().unwrap();
        let command = ["own_study", "study", "light", "--quick", "--out", out];
        assert_eq!(super::cli::main(command, &launcher), 0);
        let page = format!("{out}.html");
        let report = ["own_study", "report", out, "--out", page.as_str()];
        assert_eq!(super::cli::main(report, &launcher), 0);
        assert!(
            std::fs::read_to_string(page)
                .unwrap()
                .contains("The check passed.")
        );
    }
}
