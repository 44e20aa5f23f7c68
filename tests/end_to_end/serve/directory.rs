//! The run directory: one device at a time, and reuse of what a killed device leaves behind.

use crate::served::{Served, serve, text};
use std::io::Read;
use std::process::Stdio;

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
