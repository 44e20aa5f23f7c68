//! Recording files on the command line.

use crate::alone;
use crate::served::{Served, phasmid, serve, text};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn run(args: &[&str], file: &Path) -> Output {
    phasmid().args(args).arg(file).output().unwrap()
}

#[test]
fn existing_file_is_kept_unless_forced() {
    let _alone = alone();
    let base = tempfile::tempdir().unwrap();
    let file = base.path().join("thesis.tex");
    fs::write(&file, "years of work and toil").unwrap();
    let run_dir = base.path().join("run");
    let refused = serve()
        .args(["--record", file.to_str().unwrap(), "--run-dir"])
        .arg(&run_dir)
        .output()
        .unwrap();
    assert_eq!(refused.status.code(), Some(2), "{}", text(&refused));
    assert!(text(&refused).contains("--force"), "{}", text(&refused));
    assert!(!run_dir.exists());
    let scan = phasmid()
        .args(["scan", "--camera", "socket:none", "--control", "none"])
        .args(["--record", file.to_str().unwrap(), "--out"])
        .arg(base.path().join("out"))
        .output()
        .unwrap();
    assert_eq!(scan.status.code(), Some(2), "{}", text(&scan));
    assert!(text(&scan).contains("--force"), "{}", text(&scan));
    assert_eq!(fs::read(&file).unwrap(), b"years of work and toil");
    for command in [&["replay"][..], &["record", "info"]] {
        let refused = run(command, &file);
        assert_eq!(refused.status.code(), Some(2), "{}", text(&refused));
        assert!(text(&refused).contains("years of"), "{}", text(&refused));
    }
    let served = Served::start(&["--force", "--record", file.to_str().unwrap()]);
    assert_eq!(served.instrument().query("*TST?").unwrap(), "0");
    served.stop(rustix::process::Signal::TERM);
    let info = run(&["record", "info"], &file);
    assert!(
        text(&info).contains("ends         in order"),
        "{}",
        text(&info)
    );
    let nobody = run(&["record", "info"], &base.path().join("none"));
    assert_eq!(nobody.status.code(), Some(2), "{}", text(&nobody));
}

#[test]
fn a_recording_has_a_device_and_a_place_of_its_own() {
    let _alone = alone();
    let base = tempfile::tempdir().unwrap();
    let at = |name: &str| base.path().join(name);
    // A recording inside the run directory is rejected, under any of its names.
    std::os::unix::fs::symlink("run", at("alias")).unwrap();
    for file in ["run/device.json", "run/../run/a.rec", "alias/control"] {
        let refused = serve()
            .arg("--record")
            .arg(at(file))
            .arg("--force")
            .arg("--run-dir")
            .arg(at("run"))
            .output()
            .unwrap();
        assert_eq!(refused.status.code(), Some(2), "{}", text(&refused));
        let words = text(&refused);
        assert!(words.contains("a file in the run directory"), "{words}");
        assert!(!at("run").exists());
    }
    // The recording of the second of two devices already exists, so the recording of the first must
    // not be left behind.
    fs::write(at("a-webcam-grey-2.rec"), "years of work").unwrap();
    let refused = serve()
        .args(["--profile", "webcam-grey", "--record"])
        .arg(at("a.rec"))
        .arg("--run-dir")
        .arg(at("run"))
        .output()
        .unwrap();
    assert_eq!(refused.status.code(), Some(2), "{}", text(&refused));
    assert!(!at("a-webcam-grey.rec").exists() && !at("run").exists());
    assert_eq!(
        fs::read(at("a-webcam-grey-2.rec")).unwrap(),
        b"years of work"
    );
    // A device that cannot start because its port is in use.
    let busy = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = busy.local_addr().unwrap().port().to_string();
    let failed = serve()
        .args(["--tcp", &port, "--record"])
        .arg(at("b.rec"))
        .arg("--run-dir")
        .arg(at("run"))
        .output()
        .unwrap();
    assert_eq!(failed.status.code(), Some(1), "{}", text(&failed));
    assert!(!at("b.rec").exists() && !at("run").exists());
}

#[test]
fn recording_is_exported_as_text_and_read_by_python() {
    let _alone = alone();
    let base = tempfile::tempdir().unwrap();
    let at = |name: &str| base.path().join(name);
    let file = at("a.rec");
    let served = Served::start(&["--record", file.to_str().unwrap()]);
    let scan = served.scan(&at("scan"), &[]);
    assert!(scan.status.success(), "{}", text(&scan));
    served.stop(rustix::process::Signal::TERM);

    let export = phasmid()
        .args(["record", "export"])
        .arg(&file)
        .arg("--out")
        .arg(at("exported"))
        .output()
        .unwrap();
    assert!(export.status.success(), "{}", text(&export));
    let lines = fs::read_to_string(at("exported").join("conversation.txt")).unwrap();
    for needle in [
        "port < \"",
        "*IDN?",
        "pattern 12",
        "frame_000012.png",
        "ended normally",
    ] {
        assert!(lines.contains(needle), "{needle}\n{lines}");
    }
    let picture = |path: &Path| image::open(path).unwrap().into_luma8();
    let exported = picture(&at("exported").join("frame_000012.png"));
    assert_eq!(exported, picture(&at("scan").join("frame_12.png")));

    // Run the script from the documentation if Python is installed.
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/src/protocol/record/read.py");
    if let Ok(python) = Command::new("python3").arg(script).arg(&file).output() {
        assert!(python.status.success(), "{}", text(&python));
        let said = String::from_utf8(python.stdout).unwrap();
        assert_eq!(said.lines().count(), lines.lines().count());
        assert!(
            said.contains("frame 12, 640 x 480 GREY, 307200 bytes"),
            "{said}"
        );
    }
}
