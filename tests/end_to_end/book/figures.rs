//! Checks that figures in the README and the book equal the output of a study or a command.

use super::{pages, text};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

const README: &str = include_str!("../../../README.md");

fn snapshot(name: &str) -> String {
    let studies = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/studies");
    let path: PathBuf = studies.join(name);
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Returns the tables below `<!-- study NAME -->` in the README and the book: name and text.
fn tables() -> Vec<(String, String)> {
    let mut tables = Vec::new();
    for page in pages() {
        for rest in text(&page).split("<!-- study ").skip(1) {
            let (name, rest) = rest.split_once(" -->").unwrap();
            let rest = rest.trim_start_matches('\n');
            let lines: Vec<&str> = rest.lines().take_while(|l| l.starts_with('|')).collect();
            assert!(
                lines.len() > 2,
                "{}: a table of study {name}",
                page.display()
            );
            tables.push((name.to_owned(), lines.join("\n")));
        }
    }
    tables
}

/// Returns the cells of a table's row.
fn cells(line: &str) -> Vec<&str> {
    line.trim_matches('|').split('|').map(str::trim).collect()
}

/// A table below `<!-- study NAME -->` equals the output of `phasmid study NAME` in
/// `tests/studies/NAME.md`; a name that ends in `.quick` refers to the quick form.
#[test]
fn tables_equal_output_of_the_studies() {
    let found = tables();
    for (name, table) in &found {
        let printed = snapshot(&format!("{name}.md"));
        assert!(printed.contains(table), "study {name} has no\n{table}");
    }
    for name in ["paper", "noise", "work-precision", "sgrt", "acceptance"] {
        assert!(found.iter().any(|(known, _)| known == name), "{name}");
    }
}

/// Returns the second cell of the row that begins with a name.
fn figure(name: &str) -> &'static str {
    let start = format!("| {name} |");
    let mut rows = README.lines().filter(|line| line.starts_with(&start));
    let row = rows.next().unwrap_or_else(|| panic!("no row {name}"));
    assert!(rows.next().is_none(), "two rows {name}");
    cells(row)[1]
}

/// Returns the figures of `phasmid demo --json` for the trapezoid.
fn demo(options: &[&str]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_phasmid"))
        .args(["demo", "--scene", "trapezoid", "--json", "--out"])
        .arg(folder.path().join("demo"))
        .args(options)
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Rounds and formats a count: "110,000" for 109,530.
fn thousands(count: u64) -> String {
    format!("{},000", (count + 500) / 1000)
}

#[test]
fn accuracy_figures_equal_output_of_demo() {
    let exact = "--exact-calibration";
    let factory = demo(&[])["mae_mm"].as_f64().unwrap();
    assert_eq!(
        figure("mean absolute error with the device's factory calibration"),
        format!("{factory:.3} mm")
    );
    let said = demo(&[exact]);
    let number = |key: &str| said[key].as_f64().unwrap();
    assert_eq!(
        figure("mean absolute error"),
        format!("{:.3} mm", number("mae_mm"))
    );
    assert_eq!(number("gross_error_rate"), 0.0);
    let points = said["points"].as_u64().unwrap();
    assert_eq!(
        figure("points more than 1 mm off"),
        format!("none of {}", thousands(points))
    );
    // Rounds down, so that incomplete coverage never reads as 100 %.
    let coverage = (number("coverage") * 1e4).floor() / 100.0;
    assert_eq!(
        figure("lit and visible pixels measured"),
        format!("{coverage:.2} %")
    );
    assert_eq!(
        figure("error over the least-squares noise bound"),
        format!("{:.2}", number("ratio_to_bound"))
    );
    let without = demo(&["--no-noise", exact])["mae_mm"].as_f64().unwrap();
    assert_eq!(
        figure("mean absolute error without noise (8-bit rounding remains)"),
        format!("{without:.3} mm")
    );
}

/// The stated improvement of depth by `--weighted` equals the result of the study of noise, over the
/// scenes in front of the bench in full light.
#[test]
fn stated_gain_of_weights_equals_the_study_of_noise() {
    let study = snapshot("noise.md");
    let mut lines = study
        .lines()
        .skip_while(|line| !line.contains("weighted over bound"));
    let header = cells(lines.next().expect("a table of depth"));
    let place = |name: &str| header.iter().position(|cell| *cell == name).unwrap();
    let [plain, weighted] = ["spread over bound", "weighted over bound"].map(place);
    let rows = lines.take_while(|line| line.starts_with('|')).map(cells);
    let bench = rows.filter(|row| row[0].starts_with("pmp-bench") && row[0].ends_with(", 1"));
    let number = |cell: &str| cell.parse::<f64>().unwrap();
    let won = bench.map(|row| 100.0 * (1.0 - number(row[weighted]) / number(row[plain])));
    let won: Vec<f64> = won.map(f64::round).collect();
    assert!(won.len() >= 2);
    let [least, most] = [f64::min, f64::max].map(|f| won.iter().copied().reduce(f).unwrap());
    let range = match least == most {
        true => format!("{least}"),
        false => format!("{least} to {most}"),
    };
    let words = format!("{range} % less depth noise on `pmp-bench`");
    let page = text(Path::new("docs/src/studies/noise.md"));
    assert!(page.contains(&words), "{words}");
}
