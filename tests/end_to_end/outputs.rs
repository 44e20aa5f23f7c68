//! Runs every writing command where its output names already exist, and on a full disk.
#![cfg(target_os = "linux")]

use crate::served::{Served, phasmid, text};
#[allow(dead_code)]
use phasmid::calibrate::report;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Command, Output};
use tempfile::tempdir;

const MINE: &str = "years of work";

/// Commands that write files; a test below runs each of them.
const WRITERS: [&str; 14] = [
    "demo",
    "serve",
    "scan",
    "record export",
    "decode",
    "calibrate",
    "patient plan",
    "patient import",
    "locate",
    "track",
    "board",
    "faults matrix",
    "study",
    "report",
];

#[test]
fn every_command_that_writes_is_tested() {
    let mut found = Vec::new();
    let mut left = vec![String::new()];
    while let Some(command) = left.pop() {
        let help = text(&run(&format!("help {command}")));
        let subcommands = help.split("\nCommands:\n").nth(1).unwrap_or_default();
        let names: Vec<&str> = subcommands
            .lines()
            .take_while(|line| !line.is_empty())
            .filter_map(|line| line.strip_prefix("  ")?.split(' ').next())
            .filter(|name| !["", "help"].contains(name))
            .collect();
        left.extend(
            names
                .iter()
                .map(|name| format!("{command} {name}").trim().to_owned()),
        );
        let writes = ["--out <", "--record <"]
            .iter()
            .any(|flag| help.contains(flag));
        if writes && names.is_empty() {
            found.push(command);
        }
    }
    found.sort_unstable();
    let mut known = WRITERS.to_vec();
    known.sort_unstable();
    assert_eq!(found, known, "each is driven by a test below");
}

fn run(arguments: &str) -> Output {
    phasmid()
        .args(arguments.split_whitespace())
        .output()
        .unwrap()
}

/// Names of the files in a folder, sorted, without subfolders' contents.
fn files(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap())
        .filter(|entry| !entry.path().is_dir())
        .map(|entry| entry.file_name().into_string().unwrap())
        .collect();
    names.sort_unstable();
    names
}

/// Runs `command OUT` with an existing file and a dangling link as its output, and checks that both
/// are unchanged.
fn keeps_file(command: &str) {
    let dir = tempdir().unwrap();
    let out = dir.path().join("out");
    keeps(&format!("{command} {}", out.display()), dir.path(), "out");
}

/// Runs `command FOLDER` with each of these files in the folder, and checks that they are
/// unchanged.
fn keeps_files(command: &str, names: &[String]) {
    assert!(!names.is_empty(), "{command}");
    for name in names {
        let dir = tempdir().unwrap();
        keeps(
            &format!("{command} {}", dir.path().display()),
            dir.path(),
            name,
        );
    }
}

fn keeps(command: &str, folder: &Path, name: &str) {
    let (path, nowhere) = (folder.join(name), folder.join("nowhere"));
    let refused = || {
        let output = run(command);
        let words = text(&output);
        assert_eq!(
            output.status.code(),
            Some(2),
            "{command} over {name}: {words}"
        );
        assert!(words.contains(name), "{command} over {name}: {words}");
        assert_eq!(
            fs::read_dir(folder).unwrap().count(),
            1,
            "{command} over {name}"
        );
    };
    fs::write(&path, MINE).unwrap();
    refused();
    assert_eq!(
        fs::read_to_string(&path).unwrap(),
        MINE,
        "{command} over {name}"
    );
    fs::remove_file(&path).unwrap();
    symlink(&nowhere, &path).unwrap();
    refused();
    assert_eq!(
        fs::read_link(&path).unwrap(),
        nowhere,
        "{command} over {name}"
    );
}

/// Runs `command FOLDER` where each of these names is a link to a file, and checks that the links
/// are replaced.
fn replaces_links(command: &str, names: &[String]) {
    let (dir, elsewhere) = (tempdir().unwrap(), tempdir().unwrap());
    let target = elsewhere.path().join("mine");
    fs::write(&target, MINE).unwrap();
    for name in names {
        symlink(&target, dir.path().join(name)).unwrap();
    }
    succeeds(&format!("{command} {}", dir.path().display()));
    assert_eq!(files(dir.path()), names, "{command}");
    for name in names {
        let about = dir.path().join(name).symlink_metadata().unwrap();
        assert!(about.is_file(), "{command} wrote through {name}");
    }
    assert_eq!(fs::read_to_string(&target).unwrap(), MINE, "{command}");
}

fn succeeds(command: &str) {
    let output = run(command);
    assert!(output.status.success(), "{command}: {}", text(&output));
}

/// Runs a command that writes `out` with file sizes limited to `blocks`, as on a full disk, and
/// checks that no output remains.
fn leaves_nothing(command: &str, out: &Path, blocks: u64) {
    let program = env!("CARGO_BIN_EXE_phasmid");
    let line = format!("trap '' XFSZ; ulimit -f {blocks}; exec {program} {command}");
    let output = Command::new("bash").args(["-c", &line]).output().unwrap();
    assert_eq!(
        output.status.code(),
        Some(1),
        "{command}: {}",
        text(&output)
    );
    let left = if out.is_dir() {
        files(out).len()
    } else {
        usize::from(out.exists())
    };
    assert_eq!(left, 0, "{command}: {:?}", files(out));
}

/// [`leaves_nothing`] with a limit below the largest of the files that the command wrote to
/// `whole`.
fn leaves_nothing_in_folder(command: &str, whole: &Path) {
    let bytes = |name: &String| whole.join(name).metadata().unwrap().len();
    let most = files(whole).iter().map(bytes).max().unwrap();
    let dir = tempdir().unwrap();
    let out = dir.path().join("out");
    // Blocks of 1024 bytes.
    let blocks = (most - 1) / 1024;
    leaves_nothing(&format!("{command} {}", out.display()), &out, blocks);
}

#[test]
fn commands_with_a_single_output_keep_existing_files() {
    for command in [
        "board --out",
        "faults matrix --out",
        "locate --out",
        "track --planning none --out",
        "report none --out",
        "serve --profile dlp-evm --scene plane --run-dir /nonexistent --record",
        "scan --camera socket:none --control none --out /nonexistent/out --record",
    ] {
        keeps_file(command);
    }
    let dir = tempdir().unwrap();
    let out = dir.path().join("board.svg");
    let command = format!("board --force --out {}", out.display());
    leaves_nothing(&command, &out, 1);
    let target = dir.path().join("target");
    fs::write(&target, MINE).unwrap();
    symlink(&target, &out).unwrap();
    succeeds(&command);
    assert!(
        out.symlink_metadata().unwrap().is_file(),
        "written through the link"
    );
    assert_eq!(fs::read_to_string(&target).unwrap(), MINE);
    assert_eq!(files(dir.path()), ["board.svg", "target"]);
}

#[test]
fn demo_keeps_existing_files() {
    let dir = tempdir().unwrap();
    let command = "demo --profile dlp-evm --scene plane --out";
    succeeds(&format!("{command} {}", dir.path().display()));
    leaves_nothing_in_folder(command, dir.path());
    keeps_files(command, &files(dir.path()));
}

#[test]
fn scans_decodings_and_exports_keep_existing_files() {
    let dir = tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let (scan, recording) = (at("scan"), at("scan.rec"));
    let served = Served::start(&[]);
    let output = served.scan(&scan, &["--record", recording.to_str().unwrap()]);
    assert!(output.status.success(), "{}", text(&output));
    drop(served);
    keeps_files(
        "scan --camera socket:none --control none --out",
        &files(&scan),
    );

    let manifest = scan.join("sequence.toml");
    let calibration = scan.join("calibration.toml");
    let (decode, export) = (
        format!(
            "decode --manifest {} --calibration {}",
            manifest.display(),
            calibration.display()
        ),
        format!("record export {}", recording.display()),
    );
    for (command, out) in [(decode, at("decoded")), (export, at("exported"))] {
        succeeds(&format!("{command} --out {}", out.display()));
        leaves_nothing_in_folder(&format!("{command} --out"), &out);
        let names = files(&out);
        keeps_files(&format!("{command} --out"), &names);
        replaces_links(&format!("{command} --force --out"), &names);
    }
}

#[test]
fn plannings_keep_existing_files() {
    let dir = tempdir().unwrap();
    let planning = dir.path().join("planning");
    let plan = "patient plan p01-woman-mean --spacing-mm 20 --ct";
    leaves_nothing(
        &format!("{plan} --out {}", planning.display()),
        &planning,
        100,
    );
    succeeds(&format!("{plan} --out {}", planning.display()));
    let names = files(&planning);
    keeps_files(&format!("{plan} --out"), &names);
    replaces_links(&format!("{plan} --force --out"), &names);

    let from = planning.display();
    let import = format!(
        "patient import --ct {from}/ct_50.mha --phase 0={from}/dvf_00.mha --tumour {from}/tumour.ply"
    );
    let names = [
        "planning.toml",
        "skin.ply",
        "tumour.ply",
        "dvf_00.mha",
        "dvf_50.mha",
    ];
    keeps_files(&format!("{import} --out"), &names.map(String::from));
}

#[test]
fn calibrations_and_studies_keep_existing_files() {
    let truth = [
        "truth.json",
        "calibration.yml",
        "calibration.xml",
        "found_00.png",
    ];
    let names: Vec<String> = report::FILES
        .iter()
        .chain(&truth)
        .map(|&s| s.into())
        .collect();
    keeps_files("calibrate --profile dlp-evm --out", &names);
    keeps_files(
        "calibrate --profile dlp-evm --keep-captures --out",
        &["captures".into()],
    );
    // Files of a study in a folder that it has created, which belongs to it from then on.
    let names = [
        "study.json",
        "rows.csv",
        "tables.md",
        "report.html",
        "files",
    ];
    keeps_files("study noise --quick --out", &names.map(String::from));
}
