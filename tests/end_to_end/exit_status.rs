//! Exit status when an output stream or a camera fails.
#![cfg(target_os = "linux")]

use phasmid::protocol::Endpoints;
use std::fs::OpenOptions;
use std::net::TcpListener;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Commands that print to standard output.
const PRINTING: &[&[&str]] = &[
    &["profile", "list"],
    &["faults", "list"],
    &["--help"],
    &["scan", "--help"],
    &["--version"],
];

fn phasmid(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_phasmid"));
    command.args(args);
    command
}

/// Returns a command that runs a shell script, in which `$0` is the program.
fn shell(script: &str) -> Command {
    let mut command = Command::new("sh");
    command.args(["-c", script, env!("CARGO_BIN_EXE_phasmid")]);
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
fn closed_standard_error_keeps_the_exit_status() {
    let status = shell("exec \"$0\" compare missing.ply --truth missing.ply 2>&-")
        .status()
        .unwrap();
    assert_eq!(status.code(), Some(2));
    // A usage error, which the parser of the command line reports.
    let status = shell("exec \"$0\" scan --no-such-option 2>/dev/full")
        .status()
        .unwrap();
    assert_eq!(status.code(), Some(2));
}

#[test]
fn too_little_memory_ends_the_program_with_a_message_and_status_1() {
    // Limits of the address space in KiB, lowered until one is too low.
    let limits = std::iter::successors(Some(8_000_000_u64), |limit| Some(limit * 9 / 10));
    let refused = limits.take(60).find_map(|limit| {
        let script = format!("ulimit -v {limit}; exec \"$0\" profile check pmp-bench");
        let output = shell(&script).output().unwrap();
        (!output.status.success()).then_some((limit, output))
    });
    let (limit, output) = refused.expect("a limit that is too low");
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{limit} KiB: {message}");
    let causes = [
        "phasmid: out of memory: ",
        "phasmid: threads of parallel work: ",
    ];
    let named = causes.iter().any(|cause| message.contains(cause));
    assert!(named, "{limit} KiB: {message}");
    assert!(message.contains("ulimit -v"), "{message}");
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

/// Runs a command in a folder, and requires that it is refused with status 2 and these words.
fn refused(folder: &Path, line: &str, words: &[&str]) {
    let args: Vec<&str> = line.split(' ').collect();
    let output = phasmid(&args).current_dir(folder).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{line}: {message}");
    for word in words {
        assert!(message.contains(word), "{line}: {message}");
    }
}

#[test]
fn settings_that_nothing_uses_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = phasmid(&["sequence", "show", "webcam-grey", "--toml"]).output();
    std::fs::write(folder.path().join("m.toml"), manifest.unwrap().stdout).unwrap();
    let (profile, scene) = ("camera.f_number=4.0", "object[0].albedo=0.4");
    for (command, setting, word) in [
        ("station show two-pods", profile, "two-pods is a station"),
        ("profile show webcam-grey", scene, "a field of a scene"),
        ("profile check webcam-grey", scene, "a field of a scene"),
        ("profile check scpi", profile, "scpi is a dialect"),
        ("scene show plane", profile, "a field of a profile"),
        ("scene check plane", profile, "a field of a profile"),
        ("sequence show m.toml", profile, "m.toml is a manifest"),
        ("sequence list webcam-grey", scene, "a field of a scene"),
        (
            "calibrate --captures . --out out",
            profile,
            "--captures uses no profile",
        ),
    ] {
        let line = format!("{command} --set {setting}");
        refused(folder.path(), &line, &[&format!("--set {setting}: "), word]);
    }
}

#[test]
fn track_refuses_seconds_out_of_range() {
    for seconds in ["0", "-1", "nan", "1e7"] {
        let line = format!("track --run-dir none --planning none --seconds={seconds}");
        refused(Path::new("."), &line, &["--seconds: ", "0.001 to 1000000"]);
    }
}

#[test]
fn run_directory_that_is_a_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("mine"), "mine").unwrap();
    refused(
        folder.path(),
        "serve --run-dir mine",
        &["--run-dir mine: a file"],
    );
    refused(
        folder.path(),
        "serve --profile two-pods --run-dir mine/run",
        &["--run-dir mine/run: mine, a file"],
    );
    refused(
        folder.path(),
        "replay none.rec --run-dir mine",
        &["--run-dir mine: a file"],
    );
}

#[test]
fn manifest_without_frames_is_reported_as_a_manifest() {
    let folder = tempfile::tempdir().unwrap();
    let projector = "[projector]\nwidth_px = 64\nheight_px = 48\n";
    std::fs::write(folder.path().join("m.toml"), projector).unwrap();
    refused(
        folder.path(),
        "sequence show m.toml",
        &["m.toml", "`frame`"],
    );
}

#[test]
fn scan_checks_its_inputs_before_the_capture() {
    let folder = tempfile::tempdir().unwrap();
    let scan = "scan --camera socket:none --control none";
    refused(
        folder.path(),
        &format!("{scan} --out out --method height --reference absent"),
        &["--reference: absent/sequence.toml"],
    );
    // Inputs that the scan would overwrite.
    let out = folder.path().join("out");
    std::fs::create_dir(&out).unwrap();
    for (option, name) in [
        ("--manifest", "sequence.toml"),
        ("--calibration", "calibration.toml"),
    ] {
        std::fs::write(out.join(name), "mine").unwrap();
        refused(
            folder.path(),
            &format!("{scan} --force --out out {option} out/{name}"),
            &["--out out: ", option],
        );
        assert_eq!(std::fs::read_to_string(out.join(name)).unwrap(), "mine");
    }
}

#[test]
fn profile_whose_fields_do_not_meet_is_checked_with_a_warning() {
    let check = |rotation: &str| {
        let setting = format!("projector.rotation_deg=[0.0, {rotation}, 0.0]");
        let args = ["profile", "check", "webcam-grey", "--set", &setting];
        let output = phasmid(&args).output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{message}");
        message.contains("fields of view of camera and projector do not meet")
    };
    assert!(!check("0.0"));
    assert!(check("180.0"));
}

#[test]
fn closed_pipe_ends_quietly() {
    for args in PRINTING {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let output = phasmid(args)
            .stdout(writer)
            .stderr(Stdio::piped())
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0), "{args:?}");
        assert!(output.stderr.is_empty(), "{args:?}");
    }
}

#[test]
fn full_standard_output_is_a_failure() {
    for args in PRINTING {
        let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = phasmid(args)
            .stdout(full)
            .stderr(Stdio::piped())
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(1), "{args:?}");
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(message.contains("standard output: "), "{message}");
    }
}

/// A limit on file size whose signal is ignored has the same effect as a full disk.
#[test]
fn file_that_cannot_be_completed_does_not_block_the_next_run() {
    let folder = tempfile::tempdir().unwrap();
    let board = |limit: &str| {
        let script = format!("{limit} exec \"$0\" board --out board.svg");
        shell(&script).current_dir(folder.path()).output().unwrap()
    };
    let output = board("trap '' XFSZ; ulimit -f 4;");
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains("board.svg: "), "{message}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    assert_eq!(board("").status.code(), Some(0));
}

/// A device continues to run after the reader of its announcements has closed the stream.
#[test]
fn serve_survives_closed_output_streams() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let mut device = phasmid(&["serve", "--profile", "webcam-grey", "--scene", "plane"])
        .args(["--clock", "fast", "--while-stdin", "--run-dir"])
        .arg(&run)
        .stdin(Stdio::piped())
        .stdout(writer.try_clone().unwrap())
        .stderr(writer)
        .spawn()
        .unwrap();
    let end = Instant::now() + Duration::from_secs(60);
    while !run.join("device.json").exists() && Instant::now() < end {
        std::thread::sleep(Duration::from_millis(10));
    }
    let endpoints = Endpoints::read(&run).unwrap();
    let scan = phasmid(&["scan", "--camera", &endpoints.camera, "--out", "scan"])
        .arg("--control")
        .arg(&endpoints.control)
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert_eq!(scan.status.code(), Some(0));
    drop(device.stdin.take());
    assert_eq!(device.wait().unwrap().code(), Some(0));
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
