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
    assert_eq!(source, "INT", "left as it was found");
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
    // The sequence cannot be decoded: the scan reports this and keeps the frames, unless decoding
    // was not requested.
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
