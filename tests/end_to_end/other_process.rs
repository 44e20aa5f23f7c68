//! A device in another process, driven only through its ports, compared with the same device in
//! memory.

use crate::served::{LONG, Served, phasmid, serve, text};
use phasmid::{Device, ScanOptions, Scanner};

#[test]
fn a_device_in_another_process_gives_the_bytes_of_one_in_memory() {
    let served = Served::spawn(serve().args(["--seed", "3"]));
    let options = ScanOptions {
        sequence: Some("quick-4".to_owned()),
        frame_timeout: LONG,
        reply_timeout: LONG,
        ..ScanOptions::default()
    };
    let mut scanner = Scanner::of_run_dir(&served.dir, options).unwrap();
    let far = [scanner.scan().unwrap(), scanner.scan().unwrap()];
    scanner.finish().unwrap();

    let device = Device::builder().profile("webcam-grey").scene("plane");
    let mut device = device.seed(3).build().unwrap();
    let near = [(); 2].map(|()| device.scan("quick-4").unwrap());
    for (far, near) in far.iter().zip(&near) {
        assert_eq!(far.idn, near.idn);
        assert_eq!(far.manifest, near.manifest);
        assert_eq!(far.calibration, near.calibration);
        assert!(far.images == near.images, "other pixels");
    }
    assert!(
        far[0].images != far[1].images,
        "the noise of each scan differs"
    );
}

#[test]
fn scan_takes_the_addresses_from_the_run_directory_and_writes_the_truth() {
    let served = Served::start(&[]);
    let folder = tempfile::tempdir().unwrap();
    let scan = |arguments: &[&str]| {
        let mut command = phasmid();
        command.current_dir(&folder).arg("scan").args(arguments);
        command.output().unwrap()
    };
    let run_dir = served.dir.to_str().unwrap();
    let output = scan(&["--run-dir", run_dir, "--truth"]);
    assert!(output.status.success(), "{}", text(&output));
    for name in ["cloud.ply", "truth.npz", "truth_depth.png"] {
        assert!(
            folder.path().join("phasmid-scan").join(name).is_file(),
            "{name}"
        );
    }
    let absent = scan(&["--run-dir", "absent", "--out", "other"]);
    assert_eq!(absent.status.code(), Some(2), "{}", text(&absent));
    assert!(text(&absent).contains("--run-dir"), "{}", text(&absent));
    // The same addresses without a `device.json`, as for a physical device.
    let link = folder.path().join("port");
    std::os::unix::fs::symlink(&served.at.control, &link).unwrap();
    let physical = [
        "--camera",
        &served.at.camera,
        "--control",
        "port",
        "--truth",
        "--out",
        "other",
    ];
    let output = scan(&physical);
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    assert!(
        text(&output).contains("a physical one has no truth"),
        "{}",
        text(&output)
    );
}

/// A scan refuses the run directory of a killed device, because the port's path may now lead to
/// another terminal.
#[test]
fn scan_refuses_the_run_directory_of_a_killed_device() {
    let mut served = Served::start(&[]);
    served.child.kill().unwrap();
    served.child.wait().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut command = phasmid();
    command.current_dir(&folder).args(["scan", "--run-dir"]);
    let output = command.arg(&served.dir).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    assert!(
        text(&output).contains("no longer runs"),
        "{}",
        text(&output)
    );
    let parent = served.dir.parent().unwrap();
    let output = phasmid()
        .args(["scan", "--run-dir", parent.to_str().unwrap()])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    assert!(
        text(&output).contains("expected one of"),
        "{}",
        text(&output)
    );
}

#[test]
fn run_directory_that_device_json_cannot_name_is_refused() {
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join(std::ffi::OsStr::from_bytes(b"run-\xff"));
    let output = serve().arg("--run-dir").arg(dir).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", text(&output));
    assert_eq!(text(&output).trim().lines().count(), 1, "{}", text(&output));
}

#[test]
fn completions_and_help_list_the_commands() {
    let bash = phasmid().args(["completions", "bash"]).output().unwrap();
    assert!(
        bash.status.success() && text(&bash).contains("calibrate"),
        "{}",
        text(&bash)
    );
    // Without arguments, the command prints a hint where to start.
    let bare = phasmid().output().unwrap();
    assert_eq!(bare.status.code(), Some(2));
    assert!(
        text(&bare).contains("Start with `phasmid demo`"),
        "{}",
        text(&bare)
    );
}
