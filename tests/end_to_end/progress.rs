//! Progress of long commands: lines are shown on a terminal, and nothing is written to a pipe.

use crate::served::{phasmid, text};
use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use std::fs::File;
use std::io::Read;
use std::process::Command;
use std::time::{Duration, Instant};
use tempfile::tempdir;

/// Runs a command whose standard error is a terminal. Returns the time until its first output there,
/// and all of that output.
fn on_terminal(mut command: Command) -> (Duration, String) {
    let terminal = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&terminal).unwrap();
    unlockpt(&terminal).unwrap();
    let path = ptsname(&terminal, Vec::new()).unwrap();
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
    command.stderr(rustix::fs::open(path, flags, Mode::empty()).unwrap());
    let begin = Instant::now();
    let mut child = command.stdout(std::process::Stdio::null()).spawn().unwrap();
    // Closes this process's copy of the terminal, so that reading ends with the command.
    drop(command);
    let mut terminal = File::from(terminal);
    let (mut first, mut shown, mut buffer) = (None, Vec::new(), [0; 4096]);
    // Reading fails when the last user of the terminal has closed it.
    while let Ok(count @ 1..) = terminal.read(&mut buffer) {
        first.get_or_insert_with(|| begin.elapsed());
        shown.extend_from_slice(&buffer[..count]);
    }
    let shown = String::from_utf8_lossy(&shown).into_owned();
    assert!(child.wait().unwrap().success(), "{shown}");
    (first.unwrap(), shown)
}

fn command(arguments: &[&str], out: &std::path::Path) -> Command {
    let mut command = phasmid();
    command.args(arguments).arg("--out").arg(out);
    command
}

#[test]
fn terminal_shows_steps_and_the_remaining_time() {
    let folder = tempdir().unwrap();
    for (name, arguments, expected) in [
        (
            "demo",
            &["demo", "--profile", "webcam-grey", "--scene", "plane"][..],
            &["preparing the device ...", "/13", "writing ..."][..],
        ),
        (
            "study",
            &["study", "noise", "--quick"],
            &["trials [", "/93", " left"],
        ),
        (
            "plan",
            &["patient", "plan", "p02-man-mean", "--spacing-mm", "10"],
            &["p02-man-mean: skin, tumour and ten fields"],
        ),
    ] {
        let (first, shown) = on_terminal(command(arguments, &folder.path().join(name)));
        for words in expected {
            assert!(shown.contains(words), "{words}: {shown}");
        }
        // On an idle machine the first output takes 0.1 s.
        assert!(first < Duration::from_secs(5), "{name}: {first:?}");
    }
}

#[test]
fn pipe_gets_no_progress() {
    let folder = tempdir().unwrap();
    for (name, arguments) in [
        ("study", &["study", "noise", "--quick"][..]),
        (
            "plan",
            &["patient", "plan", "p02-man-mean", "--spacing-mm", "10"],
        ),
    ] {
        let output = command(arguments, &folder.path().join(name))
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", text(&output));
        assert!(output.stderr.is_empty(), "{}", text(&output));
    }
}
