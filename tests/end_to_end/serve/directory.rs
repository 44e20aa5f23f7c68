//! The run directory: one device at a time, and reuse of what a killed device leaves behind.

use crate::served::{LONG, Served, serve, text};
use crate::signals;
use rustix::process::Signal;
use std::io::Read;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

#[test]
fn one_directory_serves_one_device_and_a_killed_one_is_succeeded() {
    let mut served = Served::start(&[]);
    let refused = serve().arg("--run-dir").arg(&served.dir).output().unwrap();
    assert_eq!(refused.status.code(), Some(2), "{}", text(&refused));
    assert!(
        text(&refused).contains("serves a device"),
        "{}",
        text(&refused)
    );
    assert_eq!(served.instrument().query("*TST?").unwrap(), "0", "unharmed");
    served.child.kill().unwrap();
    served.child.wait().unwrap();
    assert!(
        served.dir.join("device.json").exists(),
        "a killed device cannot clean up"
    );
    let mut child = serve()
        .arg("--run-dir")
        .arg(&served.dir)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = [0; 11];
    child
        .stdout
        .as_mut()
        .unwrap()
        .read_exact(&mut line)
        .unwrap();
    assert_eq!(&line, b"webcam-grey");
    let pid = rustix::process::Pid::from_child(&child);
    rustix::process::kill_process(pid, rustix::process::Signal::TERM).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert!(!served.dir.exists());
}

#[test]
fn signal_before_the_device_is_up_ends_it_with_success() {
    let base = tempfile::tempdir().unwrap();
    let mut child = serve()
        .arg("--run-dir")
        .arg(base.path().join("run"))
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let pid = rustix::process::Pid::from_child(&child);
    // Wait until the program has installed a handler for TERM, which is signal 15.
    let handles = || signals(child.id(), "SigCgt:") & (1 << 14) != 0;
    let end = Instant::now() + LONG;
    while !handles() {
        assert!(Instant::now() < end, "no handler");
        std::thread::sleep(Duration::from_micros(100));
    }
    rustix::process::kill_process(pid, rustix::process::Signal::TERM).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(std::fs::read_dir(base.path()).unwrap().count(), 0);
}

#[test]
fn signal_that_is_ignored_at_the_start_stays_ignored() {
    let mut shell = Command::new("sh");
    shell.args(["-c", "trap '' HUP; exec \"$0\" \"$@\""]);
    shell.arg(serve().get_program()).args(serve().get_args());
    let served = Served::spawn(&mut shell);
    // HUP is signal 1.
    assert_eq!(signals(served.child.id(), "SigIgn:") & 1, 1);
    assert_eq!(signals(served.child.id(), "SigCgt:") & 1, 0);
    served.stop(Signal::TERM);
}
