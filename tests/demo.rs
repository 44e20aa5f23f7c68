//! The demo as a user runs it: a device in a process of its own, scanned through pty and socket.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};
use tempfile::tempdir;

fn demo(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_phasma"))
        .arg("demo")
        .args(arguments)
        .arg("--out")
        .arg(folder)
        .output()
        .unwrap()
}

fn summary(folder: &Path, arguments: &[&str]) -> Value {
    let output = demo(folder, arguments);
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{words}");
    assert!(words.is_empty(), "a pipe hears nothing: {words}");
    serde_json::from_str(&std::fs::read_to_string(folder.join("summary.json")).unwrap()).unwrap()
}

#[test]
fn trapezoid_meets_its_bars_through_the_ports() {
    let folder = tempdir().unwrap();
    let s = summary(folder.path(), &["--scene", "trapezoid"]);
    let number = |key: &str| s[key].as_f64().unwrap_or_else(|| panic!("no {key} in {s}"));
    assert!(number("mae_mm") <= 0.035, "{s}");
    assert!(number("gross_error_rate") <= 0.001, "{s}");
    assert!(number("coverage") >= 0.97, "{s}");
    assert!(number("ratio_to_bound") <= 1.15, "{s}");
    assert_eq!(s["frames"], 22);
    for key in [
        "points",
        "inlier_rmse_mm",
        "hausdorff_mm",
        "mdta_mm",
        "bound_mm",
        "render_s",
        "capture_s",
        "decode_s",
    ] {
        assert!(number(key) > 0.0, "{key}: {s}");
    }
    assert!(s["crease"]["mae_mm"].as_f64().unwrap() > 0.0);
    for file in [
        "cloud.ply",
        "depth.png",
        "error.png",
        "overview.png",
        "frame_00.png",
        "frame_21.png",
        "sequence.toml",
        "calibration.toml",
    ] {
        assert!(folder.path().join(file).is_file(), "{file}");
    }
}

#[test]
fn without_noise_the_error_is_that_of_rounding() {
    let folder = tempdir().unwrap();
    let s = summary(folder.path(), &["--scene", "trapezoid", "--no-noise"]);
    assert!(s["mae_mm"].as_f64().unwrap() <= 0.012, "{s}");
    // Again into the same folder, which is the demo's own.
    summary(
        folder.path(),
        &["--scene", "sphere", "--profile", "webcam-grey"],
    );
}

#[test]
fn mistakes_are_told_and_nothing_of_the_users_is_touched() {
    let folder = tempdir().unwrap();
    let mine = folder.path().join("cloud.ply");
    std::fs::write(&mine, "mine").unwrap();
    let output = demo(folder.path(), &[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("cloud.ply"));
    assert_eq!(std::fs::read_to_string(&mine).unwrap(), "mine");

    let elsewhere = folder.path().join("new");
    for (arguments, needle) in [
        (["--profile", "nonesuch"], "pmp-bench"),
        (["--scene", "nonesuch"], "torso"),
    ] {
        let output = demo(&elsewhere, &arguments);
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{words}");
        assert!(
            words.contains("nonesuch") && words.contains(needle),
            "{words}"
        );
        assert!(!elsewhere.exists());
    }
}
