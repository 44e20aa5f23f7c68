//! Runs every command that writes files where one of the names that it writes already exists: as a
//! file, a dangling link, or a folder. The command must be refused before it has written anything.
#![cfg(target_os = "linux")]

use crate::outputs::{run, succeeds};
use crate::served::{Served, phasmid, text};
use phasmid::calibrate::report;
use phasmid::decode::output_names;
use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use tempfile::tempdir;

/// Placeholder for the output path in a command.
const OUT: &str = "@OUT";
/// Name of a user's file at the output path of a command that writes a single file.
const SINGLE: &str = "years-of-work";

/// Commands that write files; a test below runs each of them.
const WRITERS: [&str; 15] = [
    "man",
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
        // The top level lists its commands in groups.
        let (_, subcommands) = match command.is_empty() {
            true => help.split_once("\nStart here:\n").unwrap(),
            false => help.split_once("\nCommands:\n").unwrap_or_default(),
        };
        let names: Vec<&str> = subcommands
            .lines()
            .take_while(|line| !line.is_empty() || command.is_empty())
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
    assert_eq!(found, known, "each is run by a test below");
}

/// Content of a path.
#[derive(PartialEq)]
enum Entry {
    Folder,
    File(Vec<u8>),
    Link(PathBuf),
}

/// Returns everything below a folder, by path.
fn tree(folder: &Path) -> BTreeMap<PathBuf, Entry> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let about = path.symlink_metadata().unwrap();
        let entry = if about.is_symlink() {
            Entry::Link(fs::read_link(&path).unwrap())
        } else if about.is_dir() {
            all.append(&mut tree(&path));
            Entry::Folder
        } else {
            Entry::File(fs::read(&path).unwrap())
        };
        all.insert(path, entry);
    }
    all
}

/// Returns the names in a folder. Of names that differ only in digits, such as `frame_00.png`,
/// returns only the first and the last.
fn names(folder: &Path) -> Vec<String> {
    let mut families: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        let family = name.replace(|c: char| c.is_ascii_digit(), "0");
        families.entry(family).or_default().push(name);
    }
    let ends = |mut family: Vec<String>| {
        family.sort_unstable();
        family.drain(1..family.len().max(2) - 1);
        family
    };
    families.into_values().flat_map(ends).collect()
}

/// Runs `command`, in which [`OUT`] stands for a folder, in an empty folder, and returns the names
/// that it has written.
fn written(command: &str) -> Vec<String> {
    let dir = tempdir().unwrap();
    let out = dir.path().join("out");
    succeeds(&command.replace(OUT, out.to_str().unwrap()));
    names(&out)
}

/// Runs `command`, in which [`OUT`] stands for a folder, once for each of these names, which exists
/// in the folder, and requires that it is refused.
fn refuses_each(command: &str, names: impl IntoIterator<Item = impl AsRef<str>>) {
    let mut count = 0;
    for name in names {
        let name = name.as_ref();
        refuses(command, "", name);
        count += 1;
    }
    assert!(count > 0, "{command}");
}

/// Runs `command`, in which [`OUT`] stands for an existing file, and requires that it is refused.
fn refuses_single(command: &str) {
    refuses(command, SINGLE, SINGLE);
}

/// Runs `command` with `name` in a folder as a file, a dangling link and a folder. [`OUT`] stands for
/// `output` in the folder. Requires a usage error that names the file, and that nothing changes in
/// the folder, at the link's target, or in the folder for temporary files.
fn refuses(command: &str, output: &str, name: &str) {
    for kind in ["file", "link", "folder"] {
        let dir = tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        let path = at("out").join(name);
        fs::create_dir(at("out")).unwrap();
        fs::create_dir(at("tmp")).unwrap();
        match kind {
            "file" => fs::write(&path, "mine").unwrap(),
            "link" => symlink(at("nowhere"), &path).unwrap(),
            _ => {
                fs::create_dir(&path).unwrap();
                fs::write(path.join("notes.txt"), "mine").unwrap();
            }
        }
        let before = tree(dir.path());
        let command = command.replace(OUT, at("out").join(output).to_str().unwrap());
        let place = format!("{command} over the {kind} {name}");
        let output = phasmid()
            .args(command.split_whitespace())
            .env("TMPDIR", at("tmp"))
            .output()
            .unwrap();
        let words = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{place}: {words}");
        // The existing file, not the command line, must be the reason for the refusal.
        let usage = words.contains("Usage:");
        assert!(words.contains(name) && !usage, "{place}: {words}");
        let after = tree(dir.path());
        assert!(
            after == before,
            "{place}: {:?}, expected {:?}, with unchanged content",
            after.keys(),
            before.keys()
        );
    }
}

#[test]
fn commands_with_a_single_output_keep_what_exists() {
    for command in [
        "board --out @OUT",
        "faults matrix --out @OUT",
        "locate --run-dir none --out @OUT",
        "track --run-dir none --planning none --out @OUT",
        "report none --out @OUT",
        "serve --profile dlp-evm --scene plane --run-dir /nonexistent --record @OUT",
        "scan --camera socket:none --control none --out /nonexistent/out --record @OUT",
    ] {
        refuses_single(command);
    }
}

#[test]
fn demo_keeps_what_exists_but_its_own_output() {
    let command = "demo --profile dlp-evm --scene plane --out @OUT";
    let dir = tempdir().unwrap();
    let own = command.replace(OUT, dir.path().to_str().unwrap());
    succeeds(&own);
    let names = names(dir.path());
    refuses_each(command, &names);
    // A demo replaces the output of an earlier demo, unless the file that marks the folder as a
    // demo's output is missing.
    succeeds(&own);
    fs::remove_file(dir.path().join("summary.json")).unwrap();
    let before = tree(dir.path());
    let refused = run(&own);
    assert_eq!(refused.status.code(), Some(2), "{}", text(&refused));
    assert!(tree(dir.path()) == before);
}

#[test]
fn scan_decode_and_export_keep_what_exists() {
    let dir = tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let (scan, recording) = (at("scan"), at("scan.rec"));
    let served = Served::start(&[]);
    let output = served.scan(&scan, &["--record", recording.to_str().unwrap()]);
    assert!(output.status.success(), "{}", text(&output));
    drop(served);
    let capture = "scan --camera socket:none --control none --out @OUT";
    refuses_each(capture, names(&scan));
    refuses_each(capture, output_names());

    let decode = format!(
        "decode --manifest {} --calibration {} --out {OUT}",
        scan.join("sequence.toml").display(),
        scan.join("calibration.toml").display()
    );
    refuses_each(&decode, written(&decode));
    refuses_each(&decode, output_names());
    let export = format!("record export {} --out {OUT}", recording.display());
    refuses_each(&export, written(&export));
}

#[test]
fn plannings_keep_what_exists() {
    let dir = tempdir().unwrap();
    let from = dir.path().display();
    let plan = "patient plan p01-woman-mean --spacing-mm 20 --ct --out @OUT";
    succeeds(&plan.replace(OUT, dir.path().to_str().unwrap()));
    refuses_each(plan, names(dir.path()));
    let import = format!(
        "patient import --ct {from}/ct_50.mha --phase 0={from}/dvf_00.mha \
         --tumour {from}/tumour.ply --with-ct --out {OUT}"
    );
    refuses_each(&import, written(&import));
}

#[test]
fn calibration_keeps_what_exists() {
    let dir = tempdir().unwrap();
    let command = "calibrate --profile dlp-evm --poses 4 --keep-captures --out @OUT";
    succeeds(&command.replace(OUT, dir.path().to_str().unwrap()));
    refuses_each(command, names(dir.path()));
    refuses_each(command, report::FILES);
    let captures = dir.path().join("captures");
    let again = format!(
        "calibrate --captures {} --board dots --out {OUT}",
        captures.display()
    );
    refuses_each(&again, report::FILES);
}

#[test]
fn forced_calibration_follows_no_link() {
    let (dir, elsewhere) = (tempdir().unwrap(), tempdir().unwrap());
    let pose = elsewhere.path().join("pose_00");
    fs::create_dir(&pose).unwrap();
    fs::write(pose.join("sequence.toml"), "mine").unwrap();
    symlink(elsewhere.path(), dir.path().join("captures")).unwrap();
    let command = format!(
        "calibrate --profile dlp-evm --poses 4 --keep-captures --force --out {}",
        dir.path().display()
    );
    let before = tree(elsewhere.path());
    let refused = run(&command);
    assert_eq!(refused.status.code(), Some(2), "{}", text(&refused));
    assert!(text(&refused).contains("captures"), "{}", text(&refused));
    assert!(tree(elsewhere.path()) == before);
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
}

#[test]
fn man_pages_keep_what_exists() {
    let pages = written("man --out @OUT");
    assert!(pages.len() > 40, "{pages:?}");
    refuses_each("man --out @OUT", pages.iter().take(3));
}

#[test]
fn study_keeps_what_exists() {
    let command = "study noise --quick --out @OUT";
    refuses_each(command, written(command));
    refuses_each(command, ["files"]);
}
