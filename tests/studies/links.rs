//! `phasmid study speed --only link`: every link has its rows, and features that the machine lacks
//! are named.

use std::collections::HashMap;
use std::path::Path;
use std::process::{Command, Output};

fn study(arguments: &[&str], out: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_phasmid"))
        .args(["study", "speed", "--quick"])
        .args(arguments)
        .arg("--out")
        .arg(out)
        .output()
        .unwrap()
}

/// Rows of `rows.csv`, keyed by column. No tested value contains a comma before its note, which is
/// the last column.
fn rows(folder: &Path) -> Vec<HashMap<String, String>> {
    let text = std::fs::read_to_string(folder.join("rows.csv")).unwrap();
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let row = |line: &str| {
        let cells = line.splitn(header.len(), ',').map(str::to_owned);
        header
            .iter()
            .map(|name| (*name).to_owned())
            .zip(cells)
            .collect()
    };
    lines.map(row).collect()
}

#[test]
fn every_link_has_figures_or_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let output = study(&["--only", "link"], folder.path());
    assert!(output.status.success(), "{output:?}");
    let rows = rows(folder.path());
    let report = std::fs::read_to_string(folder.path().join("report.html")).unwrap();
    assert_eq!(rows.len(), 12, "six links, one by one and in sequences");
    for row in &rows {
        let (name, state) = (row["name"].as_str(), row["state"].as_str());
        if state == "lacking" {
            assert!(
                ["pty and V4L2", "USB of the kernel"].contains(&name)
                    || cfg!(not(target_os = "linux"))
            );
            assert!(row["note"].len() > 10, "{row:?}");
            let said = format!("{name} is left out, this machine lacks it: ");
            assert!(report.contains(&said), "{said}");
            continue;
        }
        assert_eq!(state, "", "{row:?}");
        let number = |column: &str| row[column].parse::<f64>().unwrap();
        // 380 x 160 pixels and the data line.
        assert_eq!(number("bytes"), 61180.0);
        if row["group"] == "latency" {
            let [least, median, p99, most] =
                ["least_us", "median_us", "p99_us", "most_us"].map(number);
            assert!(number("copy_us") < least, "{row:?}");
            assert!(least <= median && median <= p99 && p99 <= most, "{row:?}");
            assert_eq!(number("frames"), 132.0);
        } else {
            let [low, rate, high] = ["rate_low", "rate", "rate_high"].map(number);
            // No link is faster than a memory copy of its data.
            assert!(high < 1e6 / number("copy_us"), "{row:?}");
            assert!(0.0 < low && low <= rate && rate <= high, "{row:?}");
            assert!(number("lost") == 0.0 || name == "pty and V4L2", "{row:?}");
            assert_eq!(number("frames"), 132.0);
        }
    }
    let in_memory = rows.iter().find(|row| row["name"] == "in memory").unwrap();
    assert_eq!(in_memory["state"], "");
    // The folder belongs to this part of the study only.
    let again = study(&[], folder.path());
    assert_eq!(again.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&again.stderr).contains("--only link"));
}

#[test]
fn parts_that_are_none_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let output = study(&["--only", "nonesuch"], &folder.path().join("new"));
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{words}");
    for word in ["nonesuch", "pass", "pair", "link"] {
        assert!(words.contains(word), "{words}");
    }
    assert!(
        !folder.path().join("new").exists(),
        "nothing is left behind"
    );
}
