//! Runs a study in the test's process and compares its tables with a snapshot.

use phasmid::study::ALL;
use phasmid::study::lab::{Settings, Surroundings, run};
use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::time::Instant;

/// Largest relative difference of a number from the snapshot, if its column is not in [`COLUMNS`].
const TOLERANCE: f64 = 0.02;

/// Columns whose numbers may differ by more, each with its relative tolerance: statistics of few or of
/// extreme values, which a change in the last bit of a pixel moves.
const COLUMNS: &[(&str, f64)] = &[];

/// Checks the quick form; its snapshot is `tests/studies/NAME.quick.md`.
pub fn quick(name: &str) {
    compare(name, true);
}

/// Checks the full form; its snapshot is `tests/studies/NAME.md`, from which the book's tables are copied.
pub fn whole(name: &str) {
    compare(name, false);
}

/// Runs a study with seed 1 in a new folder, asserts that all its checks pass, and compares its tables,
/// except tables of times, with the snapshot. With `PHASMID_BLESS=1` in the environment, rewrites the
/// snapshot.
fn compare(name: &str, quick: bool) {
    let study = *ALL.iter().find(|study| study.name() == name).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let begin = Instant::now();
    let around = Surroundings {
        clock: &|| begin.elapsed(),
        jobs: 1,
        revision: "test",
    };
    let settings = Settings {
        quick,
        seed: 1,
        only: None,
    };
    let document = run(study, folder.path(), &settings, &around, &|_, _, _| {}).unwrap();
    println!("{name}: {:.1} s", begin.elapsed().as_secs_f64());
    let found = document.markdown(false);
    let form = if quick { ".quick" } else { "" };
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let path = root.join(format!("tests/studies/{name}{form}.md"));
    if std::env::var("PHASMID_BLESS").is_ok_and(|v| v == "1") {
        fs::write(&path, &found).unwrap();
    }
    let failed: Vec<_> = document.checks().filter(|check| !check.passed()).collect();
    assert!(failed.is_empty(), "{failed:#?}");
    assert!(document.checks().count() > 0, "nothing is checked");
    let wanted = fs::read_to_string(&path).unwrap();
    let differences = differences(&found, &wanted);
    assert!(
        differences.is_empty(),
        "{}:\n{differences}\nPHASMID_BLESS=1 accepts them",
        path.display()
    );
}

/// Lists the lines that differ: text has to be equal, a number may differ by the tolerance of its column
/// and by one unit of its last decimal.
fn differences(found: &str, wanted: &str) -> String {
    let mut out = String::new();
    let mut header = Vec::new();
    let (mut found_lines, mut wanted_lines) = (found.lines(), wanted.lines());
    for number in 1.. {
        let [new, old] = [found_lines.next(), wanted_lines.next()].map(|line| line.map(cells));
        let (new, old) = match (new, old) {
            (None, None) => break,
            (new, old) => (new.unwrap_or_default(), old.unwrap_or_default()),
        };
        if new.len() != header.len() {
            header.clone_from(&new);
        }
        let same = |(i, (new, old)): (usize, (&&str, &&str))| {
            let column = header.get(i).copied().unwrap_or_default();
            let known = COLUMNS.iter().find(|(name, _)| *name == column);
            is_close(
                new,
                old,
                known.map_or(TOLERANCE, |(_, tolerance)| *tolerance),
            )
        };
        if new.len() != old.len() || !new.iter().zip(&old).enumerate().all(same) {
            let _ = writeln!(
                out,
                "line {number}: {}, snapshot: {}",
                new.join(" | "),
                old.join(" | ")
            );
        }
    }
    out
}

/// Returns the cells of a row, or a line of text as one cell. Column widths are ignored.
fn cells(line: &str) -> Vec<&str> {
    let rule = |cell: &&str| cell.chars().all(|c| c == '-' || c == ':');
    let cells: Vec<_> = line.split('|').map(str::trim).collect();
    match cells.len() > 1 && cells.iter().all(rule) {
        true => Vec::new(),
        false => cells,
    }
}

/// Returns whether two cells have the same text and nearly equal numbers.
fn is_close(found: &str, wanted: &str, tolerance: f64) -> bool {
    let [found, wanted] = [found, wanted].map(parts);
    let close = |(found, wanted): (&&str, &&str)| {
        if number(found) == 0 || number(wanted) == 0 {
            return found == wanted;
        }
        let [a, b]: [f64; 2] = [found, wanted].map(|part| part.parse().unwrap());
        let unit = if found.contains('e') {
            0.0
        } else {
            last_decimal(found).max(last_decimal(wanted))
        };
        (a - b).abs() <= tolerance * a.abs().max(b.abs()) + unit * (1.0 + 1e-9)
    };
    found.len() == wanted.len() && found.iter().zip(&wanted).all(close)
}

/// Returns one unit of a number's last decimal place; 0 for a whole number, which is a count.
fn last_decimal(number: &str) -> f64 {
    number
        .split_once('.')
        .map_or(0.0, |(_, decimals)| 0.1_f64.powi(decimals.len() as i32))
}

/// Splits a cell into numbers and the text between them.
fn parts(cell: &str) -> Vec<&str> {
    let mut parts = Vec::new();
    let mut rest = cell;
    while !rest.is_empty() {
        let end = match number(rest) {
            0 => (1..rest.len())
                .find(|&i| rest.is_char_boundary(i) && number(&rest[i..]) > 0)
                .unwrap_or(rest.len()),
            length => length,
        };
        parts.push(&rest[..end]);
        rest = &rest[end..];
    }
    parts
}

/// Returns the length of the number at the beginning of a text; 0 if there is none.
fn number(text: &str) -> usize {
    let digits = |from: usize| text[from..].bytes().take_while(u8::is_ascii_digit).count();
    let sign = usize::from(text.starts_with('-'));
    let whole = digits(sign);
    if whole == 0 {
        return 0;
    }
    let mut end = sign + whole;
    if text[end..].starts_with('.') && digits(end + 1) > 0 {
        end += 1 + digits(end + 1);
    }
    for exponent in ["e-", "e"] {
        let begin = end + exponent.len();
        if text[end..].starts_with(exponent) && digits(begin) > 0 {
            return begin + digits(begin);
        }
    }
    end
}

#[test]
fn snapshots_differ_by_text_and_by_more_than_the_tolerance() {
    let table = |row: &str| format!("| name | rms |\n| --- | ---: |\n{row}\n");
    let held = table("| 12 steps, p01 | 0.500 (0.4 to 1.2e-3) |");
    for same in [
        "|  12 steps, p01 |  0.509 (0.4 to 1.21e-3) |",
        "| 12 steps, p01 | 0.500 (0.5 to 1.2e-3) |",
    ] {
        assert_eq!(differences(&table(same), &held), "", "{same}");
    }
    for other in [
        "| 12 steps, p01 | 0.520 (0.4 to 1.2e-3) |",
        "| 12 steps, p01 | -0.500 (0.4 to 1.2e-3) |",
        "| 12 steps, p01 | 0.500 (0.4 to 1.2e-4) |",
        "| 13 steps, p01 | 0.500 (0.4 to 1.2e-3) |",
        "| 12 steps, q01 | 0.500 (0.4 to 1.2e-3) |",
        "| 12 steps, p01 | - |",
        "| 12 steps, p01 | NaN (0.4 to 1.2e-3) |",
        "",
    ] {
        assert_ne!(differences(&table(other), &held), "", "{other}");
    }
    assert_ne!(differences(&(held.clone() + "| more | 1 |\n"), &held), "");
    assert_ne!(differences(&held, &(held.clone() + "| more | 1 |\n")), "");
}
