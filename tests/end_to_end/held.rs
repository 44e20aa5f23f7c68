//! `--held` as a user runs it, on a camera that resolves the projector's pixels.

use serde_json::Value;
use std::fmt::Write;
use std::path::Path;
use std::process::Command;

/// Returns a profile with 0.51 projector pixels per camera pixel: the centre of the image of a 12 mm
/// lens on 1280 x 1024 pixels of 4.8 um, and a projector of 912 x 1140 pixels without blur.
fn profile() -> String {
    let mut text = include_str!("../../device-profiles/webcam-grey.toml")
        .split("[calibration]")
        .next()
        .unwrap()
        .to_owned();
    for (from, to) in [
        ("name = \"webcam-grey\"", "name = \"fine\""),
        ("width_px = 640", "width_px = 480"),
        ("height_px = 480\nfocal", "height_px = 320\nfocal"),
        ("focal_length_mm = 4.0", "focal_length_mm = 12.0"),
        ("sensor_width_mm = 3.6", "sensor_width_mm = 2.304"),
        ("width_px = 854", "width_px = 912"),
        ("height_px = 480\nthrow", "height_px = 1140\nthrow"),
        ("[239.12, 0.0]", "[191.52, 0.0]"),
        ("[200.0, 0.0, 0.0]", "[150.0, 0.0, 0.0]"),
    ] {
        let places = text.match_indices(from).count();
        assert!(places > 0, "{from}");
        text = text.replacen(from, to, 1);
    }
    text += "[[sequence]]\nname = \"five\"\nperiod_us = 16000.0\n";
    let mut frame =
        |pattern: &str| writeln!(text, "[[sequence.frame]]\npattern = {{ {pattern} }}").unwrap();
    for i in 0..5 {
        let phase = std::f64::consts::TAU * f64::from(i) / 5.0;
        frame(&format!(
            "kind = \"fringe\", axis = \"x\", period_px = 19, phase_rad = {phase}"
        ));
    }
    for bit in (0..6).rev() {
        frame(&format!(
            "kind = \"gray\", axis = \"x\", cell_px = 19, bits = 6, bit = {bit}"
        ));
    }
    frame("kind = \"gray\", axis = \"x\", cell_px = 9.5, bits = 7, bit = 0");
    frame("kind = \"white\"");
    frame("kind = \"black\"");
    text
}

/// Runs a command with `--json` and returns its output.
fn phasmid(arguments: &[&str]) -> Value {
    let output = Command::new(env!("CARGO_BIN_EXE_phasmid"))
        .args(arguments)
        .arg("--json")
        .output()
        .unwrap();
    let words = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {words}");
    serde_json::from_slice(&output.stdout).unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn flat_plane_of_a_fine_camera_is_measured_and_its_error_is_stated() {
    let root = tempfile::tempdir().unwrap();
    let at = |name: &str| root.path().join(name);
    let file = at("fine.toml");
    std::fs::write(&file, profile()).unwrap();
    let frames = at("frames");
    let scanned = phasmid(&[
        "demo",
        "--profile",
        text(&file),
        "--scene",
        "plane",
        "--no-noise",
        "--out",
        text(&frames),
    ]);
    let coverage = scanned["coverage"].as_f64().unwrap();
    assert!(coverage >= 0.97, "{coverage}");
    let [manifest, calibration] =
        ["sequence.toml", "calibration.toml"].map(|name| frames.join(name));
    let decoded = ["state", "correct"].map(|how| {
        let out = at(how);
        let arguments = ["decode", "--manifest", text(&manifest), "--calibration"];
        let rest = [text(&calibration), "--held", how, "--out", text(&out)];
        let report = phasmid(&[&arguments[..], &rest].concat());
        assert!(out.join("sampling_x.npy").exists());
        let notes = report["notes"].to_string();
        assert!(notes.contains("held projector pixels"), "{notes}");
        report["axes"][0]["median_sampling_px"].as_f64().unwrap()
    });
    // The first value is the closed form for half a projector pixel per camera pixel without blur,
    // the second the error that remains after a correction that uses only each pixel's own
    // coordinate.
    let [stated, left] = decoded;
    assert!((0.12..0.15).contains(&stated), "{stated}");
    assert!(left < 0.7 * stated, "{left}");
}
