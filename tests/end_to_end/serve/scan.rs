//! `phasmid scan` with and without a served device.

use crate::served::{Served, phasmid, serve, text};
use std::fs;
use std::os::unix::fs::PermissionsExt;

#[test]
fn scan_over_pty_and_socket_writes_decoder_input() {
    let served = Served::start(&["--seed", "7"]);
    assert_eq!(served.at.seed, Some(7));
    assert_eq!(
        fs::metadata(&served.dir).unwrap().permissions().mode() & 0o777,
        0o700
    );
    let out = served.dir.parent().unwrap().join("out");
    let scan = served.scan(&out, &["--json"]);
    assert_eq!(scan.status.code(), Some(0), "{}", text(&scan));
    let summary: serde_json::Value = serde_json::from_slice(&scan.stdout).unwrap();
    assert_eq!(summary["frames"], 13);
    assert_eq!(
        summary["first_id"], 0,
        "nothing was exposed before the scan"
    );
    assert_eq!(summary["calibration"], "device");
    let source = served.instrument().query("TRIG:SOUR?").unwrap();
    assert_eq!(source, "INT", "the trigger source is restored");
    for name in [
        "frame_00.png",
        "frame_12.png",
        "sequence.toml",
        "calibration.toml",
    ] {
        assert!(out.join(name).is_file(), "{name}");
    }
    let again = served.scan(&out, &[]);
    assert_eq!(again.status.code(), Some(2), "{}", text(&again));
    assert!(text(&again).contains("--force"), "{}", text(&again));
    assert!(served.scan(&out, &["--force"]).status.success());
    let moon = served.scan(&out, &["--force", "--sequence", "moon"]);
    assert_eq!(moon.status.code(), Some(2), "{}", text(&moon));
    assert!(text(&moon).contains("quick-4"), "{}", text(&moon));
    let other = out.with_file_name("other.toml");
    let calibration = fs::read_to_string(out.join("calibration.toml")).unwrap();
    fs::write(
        &other,
        calibration.replacen("width_px = 640", "width_px = 641", 1),
    )
    .unwrap();
    let none = out.with_file_name("none");
    let wrong = served.scan(&none, &["--calibration", other.to_str().unwrap()]);
    assert_eq!(wrong.status.code(), Some(2), "{}", text(&wrong));
    for needle in ["other.toml: camera.lens", "641 x 480", "640 x 480"] {
        assert!(text(&wrong).contains(needle), "{}", text(&wrong));
    }
    assert!(!none.exists(), "refused before anything is captured");
    served.stop(rustix::process::Signal::TERM);
}

#[test]
fn a_sequence_from_a_file_is_projected() {
    let base = tempfile::tempdir().unwrap();
    let file = base.path().join("mine.toml");
    let manifest = "[projector]\nwidth_px = 854\nheight_px = 480\n\
        [[frame]]\npattern = { kind = \"image\", file = \"dots.png\" }\n\
        [[frame]]\npattern = { kind = \"white\" }\n";
    fs::write(&file, manifest).unwrap();
    let missing = serve().arg("--sequence").arg(&file).output().unwrap();
    assert_eq!(missing.status.code(), Some(2), "{}", text(&missing));
    assert!(text(&missing).contains("dots.png"), "{}", text(&missing));
    image::GrayImage::new(854, 480)
        .save(base.path().join("dots.png"))
        .unwrap();
    let served = Served::start(&["--sequence", file.to_str().unwrap()]);
    let out = base.path().join("out");
    // The sequence cannot be decoded. The scan reports this and keeps the frames, unless it was run
    // without decoding.
    let scan = served.scan(&out, &["--sequence", "mine"]);
    assert_eq!(scan.status.code(), Some(2), "{}", text(&scan));
    assert!(text(&scan).contains("neither fringes nor Gray code"));
    let scan = served.scan(
        &out,
        &["--sequence", "mine", "--json", "--no-decode", "--force"],
    );
    assert_eq!(scan.status.code(), Some(0), "{}", text(&scan));
    assert!(out.join("frame_01.png").exists() && !out.join("frame_02.png").exists());
    served.stop(rustix::process::Signal::TERM);
}

#[test]
fn missing_camera_or_port_is_reported() {
    let base = tempfile::tempdir().unwrap();
    let scan = |camera: &str, control: &str| {
        phasmid()
            .args(["scan", "--camera", camera, "--control", control, "--out"])
            .arg(base.path().join("out"))
            .output()
            .unwrap()
    };
    let none = scan("socket:/no/such/socket", "/no/such/port");
    assert_eq!(none.status.code(), Some(2), "{}", text(&none));
    assert!(text(&none).contains("/no/such/port"), "{}", text(&none));
    let not_a_port = scan("socket:/no/such/socket", "/dev/null");
    assert_eq!(not_a_port.status.code(), Some(2), "{}", text(&not_a_port));
    let served = Served::start(&[]);
    let video = scan("/dev/video9999", served.at.control.to_str().unwrap());
    assert_eq!(video.status.code(), Some(2), "{}", text(&video));
    assert!(text(&video).contains("V4L2"), "{}", text(&video));
}

#[test]
fn refused_scan_leaves_no_recording_and_keeps_an_earlier_one() {
    let served = Served::start(&[]);
    let base = tempfile::tempdir().unwrap();
    let file = base.path().join("a.rec");
    let record = ["--record", file.to_str().unwrap(), "--force"];
    let no_device = || {
        phasmid()
            .args(["scan", "--camera", "socket:none", "--control", "none"])
            .args(record)
            .arg("--out")
            .arg(base.path().join("out"))
            .output()
            .unwrap()
    };
    let no_sequence = || {
        let moon = ["--sequence", "moon"];
        served.scan(&base.path().join("out"), &[&record[..], &moon].concat())
    };
    for earlier in [None, Some("years of work")] {
        if let Some(text) = earlier {
            fs::write(&file, text).unwrap();
        }
        for refused in [no_device(), no_sequence()] {
            assert_eq!(refused.status.code(), Some(2), "{}", text(&refused));
            assert_eq!(fs::read_to_string(&file).ok().as_deref(), earlier);
            let left = fs::read_dir(base.path()).unwrap().count();
            assert_eq!(left, usize::from(earlier.is_some()), "no other file");
        }
    }
    let scan = served.scan(&base.path().join("out"), &record);
    assert!(scan.status.success(), "{}", text(&scan));
    let info = phasmid().args(["record", "info"]).arg(&file).output();
    let info = text(&info.unwrap());
    assert!(info.contains("ends         in order"), "{info}");
}

#[test]
fn scan_refuses_outputs_that_are_other_files_of_it() {
    let served = Served::start(&[]);
    let base = tempfile::tempdir().unwrap();
    let at = |name: &str| base.path().join(name);
    let refused = |out: &std::path::Path, arguments: &[&str], needle: &str| {
        let scan = served.scan(out, &[&["--force"], arguments].concat());
        assert_eq!(scan.status.code(), Some(2), "{}", text(&scan));
        assert!(text(&scan).contains(needle), "{}", text(&scan));
    };
    for out in ["", "scan", "../run/x/../scan"] {
        let out = served.dir.join(out);
        refused(&out, &[], "the run directory of the device");
    }
    let inside = served.dir.join("a.rec");
    let inside = ["--record", inside.to_str().unwrap()];
    refused(&at("scan"), &inside, "in the run directory of the device");

    fs::create_dir(at("scan")).unwrap();
    for file in ["scan/a.rec", "scan/../scan/frame_00.png"] {
        let file = at(file);
        let record = ["--record", file.to_str().unwrap()];
        refused(&at("scan"), &record, "in the folder of --out");
    }
    let scan = served.scan(&at("first"), &[]);
    assert!(scan.status.success(), "{}", text(&scan));
    for (option, name) in [
        ("--manifest", "first/sequence.toml"),
        ("--calibration", "first/calibration.toml"),
    ] {
        let file = at(name);
        let before = fs::read(&file).unwrap();
        let file = file.to_str().unwrap();
        let same = [option, file, "--record", file];
        refused(&at("scan"), &same, &format!("the file of {option}"));
        assert_eq!(fs::read(file).unwrap(), before);
    }
    assert_eq!(fs::read_dir(at("scan")).unwrap().count(), 0);
    served.stop(rustix::process::Signal::TERM);
}

#[test]
fn output_that_cannot_be_made_is_refused_before_the_device_is_opened() {
    // The kernel does not allow folders to be created here, not even by root.
    for (option, other) in [("--out", "--record"), ("--record", "--out")] {
        let base = tempfile::tempdir().unwrap();
        let output = phasmid()
            .args(["scan", "--camera", "socket:none", "--control", "none"])
            .args([option, "/proc/phasmid"])
            .arg(other)
            .arg(base.path().join("other"))
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(2), "{}", text(&output));
        let expected = format!("{option} /proc");
        assert!(text(&output).contains(&expected), "{}", text(&output));
        assert_eq!(fs::read_dir(base.path()).unwrap().count(), 0);
    }
}
