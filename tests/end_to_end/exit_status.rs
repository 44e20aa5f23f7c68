//! Exit status when an output stream or a camera fails.
#![cfg(target_os = "linux")]

use std::fs::OpenOptions;
use std::net::TcpListener;
use std::process::{Command, Stdio};

fn phasmid(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_phasmid"));
    command.args(args);
    command
}

#[test]
fn unwritable_standard_error_keeps_the_exit_status() {
    let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
    let status = phasmid(&["compare", "missing.ply", "--truth", "missing.ply"])
        .stderr(full)
        .status()
        .unwrap();
    assert_eq!(status.code(), Some(2));
}

#[test]
fn missing_files_are_named_with_their_option() {
    let absent = "/no/such/path";
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out").display().to_string();
    for (args, option) in [
        (
            vec!["track", "--run-dir", "/", "--planning", absent],
            "--planning: ",
        ),
        (
            vec!["serve", "--run-dir", absent, "--faults", absent],
            "--faults: ",
        ),
        (vec!["serve", "--sequence", absent], "--sequence: "),
        (
            vec!["locate", "--run-dir", absent, "--out", &out],
            "--run-dir: ",
        ),
        (
            vec!["decode", "--manifest", absent, "--out", &out],
            "--manifest: ",
        ),
    ] {
        let output = phasmid(&args).output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(
            message.contains(option) && message.contains(absent),
            "{message}"
        );
    }
}

#[test]
fn closed_pipe_ends_quietly() {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let output = phasmid(&["profile", "list"])
        .stdout(writer)
        .stderr(Stdio::piped())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(output.stderr.is_empty());
}

#[test]
fn full_standard_output_is_a_failure() {
    let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
    let output = phasmid(&["profile", "list"])
        .stdout(full)
        .stderr(Stdio::piped())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("standard output"));
}

#[test]
fn camera_info_of_a_silent_port_fails_with_a_message() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp:{}", listener.local_addr().unwrap());
    let output = phasmid(&["camera", "info", &address, "--timeout", "0.2"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(output.stdout.is_empty());
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains("no frame within 0.2 s"), "{message}");
}
