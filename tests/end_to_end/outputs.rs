//! Commands that write files are run with `--force` where links exist, and on a full disk.
#![cfg(target_os = "linux")]

use crate::served::{Served, phasmid, text};
use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Command, Output};
use tempfile::tempdir;

const MINE: &str = "years of work";

pub(crate) fn run(arguments: &str) -> Output {
    phasmid()
        .args(arguments.split_whitespace())
        .output()
        .unwrap()
}

/// Returns the sorted names of the files in a folder, without the contents of subfolders.
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

/// Runs `command FOLDER` where each of these names is a link to a file, and checks that the command
/// replaces the links and not their targets.
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

pub(crate) fn succeeds(command: &str) {
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

/// Same as [`leaves_nothing`], with a limit below the size of the largest file that the command has
/// written to `whole`.
fn leaves_nothing_in_folder(command: &str, whole: &Path) {
    let bytes = |name: &String| whole.join(name).metadata().unwrap().len();
    let most = files(whole).iter().map(bytes).max().unwrap();
    let dir = tempdir().unwrap();
    let out = dir.path().join("out");
    // The limit is in blocks of 1024 bytes.
    let blocks = (most - 1) / 1024;
    leaves_nothing(&format!("{command} {}", out.display()), &out, blocks);
}

#[test]
fn board_replaces_a_link_and_leaves_nothing_on_a_full_disk() {
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
fn demo_replaces_links_in_its_own_folder_and_leaves_nothing_on_a_full_disk() {
    let dir = tempdir().unwrap();
    let command = "demo --profile dlp-evm --scene plane --out";
    let again = format!("{command} {}", dir.path().display());
    succeeds(&again);
    leaves_nothing_in_folder(command, dir.path());
    let names = files(dir.path());
    let elsewhere = tempdir().unwrap();
    for name in names.iter().filter(|name| *name != "summary.json") {
        let path = dir.path().join(name);
        fs::remove_file(&path).unwrap();
        symlink(elsewhere.path().join(name), &path).unwrap();
    }
    succeeds(&again);
    assert_eq!(files(dir.path()), names);
    for name in names {
        let about = dir.path().join(&name).symlink_metadata().unwrap();
        assert!(about.is_file(), "{name}");
    }
    assert_eq!(fs::read_dir(elsewhere.path()).unwrap().count(), 0);
}

#[test]
fn decode_and_export_replace_links_and_leave_nothing_on_a_full_disk() {
    let dir = tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let (scan, recording) = (at("scan"), at("scan.rec"));
    let served = Served::start(&[]);
    let output = served.scan(&scan, &["--record", recording.to_str().unwrap()]);
    assert!(output.status.success(), "{}", text(&output));
    drop(served);
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
        replaces_links(&format!("{command} --force --out"), &files(&out));
    }
}

#[test]
fn planning_replaces_links_and_leaves_nothing_on_a_full_disk() {
    let dir = tempdir().unwrap();
    let planning = dir.path().join("planning");
    let plan = "patient plan p01-woman-mean --spacing-mm 20 --ct";
    let command = format!("{plan} --out {}", planning.display());
    leaves_nothing(&command, &planning, 100);
    succeeds(&command);
    replaces_links(&format!("{plan} --force --out"), &files(&planning));
}
