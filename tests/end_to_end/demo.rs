//! The demo as a user runs it: a device scanned through its pty and frame socket.

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};
use tempfile::tempdir;

fn demo(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_phasmid"))
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
    assert!(words.is_empty(), "no progress in a pipe: {words}");
    serde_json::from_str(&std::fs::read_to_string(folder.join("summary.json")).unwrap()).unwrap()
}

#[test]
fn trapezoid_meets_its_bars_through_the_ports() {
    let folder = tempdir().unwrap();
    let s = summary(
        folder.path(),
        &["--scene", "trapezoid", "--exact-calibration"],
    );
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
        "total_s",
    ] {
        assert!(number(key) > 0.0, "{key}: {s}");
    }
    let phases = ["start_s", "capture_s", "decode_s", "compare_s", "write_s"];
    assert!(phases.iter().all(|phase| number(phase) > 0.0), "{s}");
    let sum: f64 = phases.iter().map(|phase| number(phase)).sum();
    assert!((sum - number("total_s")).abs() < 1e-6, "{s}");
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
    let s = summary(
        folder.path(),
        &["--scene", "trapezoid", "--no-noise", "--exact-calibration"],
    );
    assert_eq!(s["calibration"], "exact");
    assert!(s["mae_mm"].as_f64().unwrap() <= 0.012, "{s}");
    // A second run may replace the folder, because it belongs to the demo.
    summary(
        folder.path(),
        &["--scene", "sphere", "--profile", "webcam-grey"],
    );
}

#[test]
fn truth_is_written_as_arrays_and_as_an_image() {
    let folder = tempdir().unwrap();
    summary(
        folder.path(),
        &["--profile", "webcam-grey", "--scene", "sphere", "--truth"],
    );
    let levels = image::open(folder.path().join("truth_depth.png"))
        .unwrap()
        .into_luma16();
    let near = levels
        .pixels()
        .map(|level| level.0[0])
        .filter(|level| *level > 0)
        .min();
    assert!(
        (5000..20_000).contains(&near.unwrap()),
        "{near:?} tenths of a millimetre"
    );
    assert!(
        std::fs::metadata(folder.path().join("truth.npz"))
            .unwrap()
            .len()
            > 640 * 480 * 49
    );
    // A later demo without `--truth` deletes the truth of the earlier one.
    summary(
        folder.path(),
        &["--profile", "webcam-grey", "--scene", "plane"],
    );
    assert!(!folder.path().join("truth.npz").exists());
}

/// By default a demo uses the calibration that the device's factory would have measured.
#[test]
fn demo_states_the_error_of_the_factory_calibration() {
    let folder = tempdir().unwrap();
    let s = summary(folder.path(), &["--scene", "trapezoid", "--no-noise"]);
    assert_eq!(s["calibration"], "factory");
    let number = |key: &str| s[key].as_f64().unwrap_or_else(|| panic!("no {key} in {s}"));
    // The error of the calibration is a single draw that is common to all points, so the ratio of
    // error and standard deviation varies widely.
    let ratio = number("inlier_rmse_mm") / number("calibration_sigma_mm");
    assert!((0.02..4.0).contains(&ratio), "{s}");
    let calibration = std::fs::read_to_string(folder.path().join("calibration.toml")).unwrap();
    assert!(calibration.contains("[covariance]"), "{calibration}");
}

#[test]
fn refuses_bad_arguments_and_keeps_existing_files() {
    let folder = tempdir().unwrap();
    let mine = folder.path().join("cloud.ply");
    std::fs::write(&mine, "mine").unwrap();
    let output = demo(folder.path(), &[]);
    assert_eq!(output.status.code(), Some(2));
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(words.contains("cloud.ply"), "{words}");
    assert!(!words.contains("--force"), "not an option of demo: {words}");
    assert_eq!(std::fs::read_to_string(&mine).unwrap(), "mine");
    std::fs::rename(&mine, folder.path().join("frame_00.png")).unwrap();
    let output = demo(folder.path(), &[]);
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{words}");
    assert!(words.contains("frame_00.png"), "{words}");
    assert!(!words.contains("--force"), "not an option of demo: {words}");

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

#[test]
fn no_measured_point_fails_without_figures() {
    let folder = tempdir().unwrap();
    let scene = folder.path().join("empty.toml");
    std::fs::write(&scene, "name = \"empty\"\ndescription = \"\"\n").unwrap();
    let out = folder.path().join("out");
    let output = demo(
        &out,
        &[
            "--profile",
            "webcam-grey",
            "--scene",
            scene.to_str().unwrap(),
        ],
    );
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("no point was measured"));
    let s: Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("summary.json")).unwrap()).unwrap();
    assert_eq!(s["points"], 0);
    for key in ["mae_mm", "gross_error_rate", "coverage", "ratio_to_bound"] {
        assert!(s[key].is_null(), "{key}: {s}");
    }
}

#[test]
fn missing_mesh_is_a_usage_error_of_one_line() {
    let folder = tempdir().unwrap();
    let scene = folder.path().join("mesh.toml");
    let text = "name = \"m\"\ndescription = \"\"\n[[object]]\nalbedo = 0.5\n\
        shape = { kind = \"mesh\", file = \"nosuch.stl\" }\n";
    std::fs::write(&scene, text).unwrap();
    let output = demo(
        &folder.path().join("out"),
        &["--scene", scene.to_str().unwrap()],
    );
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{words}");
    assert!(
        words.contains("object[0].shape.file: ") && words.contains("nosuch.stl"),
        "{words}"
    );
    assert_eq!(words.trim().lines().count(), 1, "{words}");
}

#[test]
fn the_next_demo_removes_what_a_killed_one_has_left() {
    let folder = tempdir().unwrap();
    let start = |arguments: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_phasmid"))
            .arg("demo")
            .args(arguments)
            .arg("--out")
            .arg(folder.path().join("out"))
            .stdout(std::process::Stdio::null())
            .stderr(std::process::Stdio::null())
            .env("TMPDIR", folder.path())
            .spawn()
            .unwrap()
    };
    let run_dir = || {
        let entries = std::fs::read_dir(folder.path()).unwrap();
        let mut paths = entries.map(|entry| entry.unwrap().path());
        paths.find(|path| path.to_string_lossy().contains("/phasmid-"))
    };
    // The demo renders for long enough to be killed.
    let mut child = start(&["--samples", "64"]);
    let begin = Instant::now();
    while !run_dir().is_some_and(|dir| dir.join("device.json").exists()) {
        assert!(
            begin.elapsed() < Duration::from_secs(120),
            "the device starts"
        );
        assert_eq!(
            child.try_wait().unwrap(),
            None,
            "the demo ended before it was killed"
        );
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(run_dir().is_some());
    let quick = ["--profile", "webcam-grey", "--scene", "plane"];
    assert!(start(&quick).wait().unwrap().success());
    assert_eq!(run_dir(), None);
}

#[test]
fn dialect_without_manifest_is_named_instead_of_an_option_of_scan() {
    let folder = tempdir().unwrap();
    let show = |what: &str, name: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_phasmid"));
        let output = command.args([what, "show", name]).output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    let dialect = show("dialect", "okline");
    let lines = dialect
        .lines()
        .filter(|line| !line.starts_with("manifest = "));
    let dialect = lines.collect::<Vec<_>>().join("\n");
    std::fs::write(folder.path().join("own.toml"), dialect).unwrap();
    let profile = format!(
        "{}\n[control]\ndialect = \"own.toml\"\n",
        show("profile", "webcam-grey")
    );
    let file = folder.path().join("profile.toml");
    std::fs::write(&file, profile).unwrap();
    let out = folder.path().join("out");
    let arguments = ["--scene", "plane", "--profile", file.to_str().unwrap()];
    let output = demo(&out, &arguments);
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{words}");
    let named = words.contains("profile.toml: dialect: ") && !words.contains("--manifest");
    assert!(named, "{words}");
    assert!(!out.exists());
}

#[test]
fn signals_leave_no_folder_of_the_output_or_of_the_device() {
    for signals in [
        &[crate::or_term(Signal::HUP)][..],
        &[Signal::TERM],
        &[crate::interrupt(), crate::interrupt()],
    ] {
        let folder = tempdir().unwrap();
        let out = folder.path().join("new/out");
        // The demo renders for long enough to be interrupted.
        let mut child = Command::new(env!("CARGO_BIN_EXE_phasmid"))
            .args(["demo", "--samples", "64", "--out"])
            .arg(&out)
            .env("TMPDIR", folder.path())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let has_device = || {
            let entries = std::fs::read_dir(folder.path()).unwrap();
            let mut paths = entries.map(|entry| entry.unwrap().path());
            paths.any(|path| path.join("device.json").exists())
        };
        let begin = Instant::now();
        while !has_device() {
            assert!(begin.elapsed() < Duration::from_secs(120));
            assert_eq!(child.try_wait().unwrap(), None, "the demo has ended");
            std::thread::sleep(Duration::from_millis(1));
        }
        assert!(
            out.exists(),
            "the output folder is created before the capture"
        );
        for signal in signals {
            kill_process(Pid::from_child(&child), *signal).unwrap();
            std::thread::sleep(Duration::from_millis(5));
        }
        let code = child.wait().unwrap().code().unwrap();
        assert!([1, 130].contains(&code), "{signals:?}: {code}");
        let left = std::fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(left, 0, "{signals:?}");
    }
}

#[test]
fn output_that_cannot_be_made_is_refused_before_the_device_starts() {
    // The kernel does not allow folders to be created here, not even by root.
    let out = "/proc/phasmid/out";
    let output = Command::new(env!("CARGO_BIN_EXE_phasmid"))
        .args(["demo", "--profile", "dlp-evm", "--scene", "plane"])
        .args(["--out", out])
        // With this setting the device could not start, so the error must come before the start.
        .env("TMPDIR", "/nonexistent")
        .output()
        .unwrap();
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{words}");
    assert!(words.contains("--out /proc/phasmid/out: "), "{words}");
}

#[test]
fn samples_that_make_no_grid_are_refused_before_anything_is_started() {
    let folder = tempdir().unwrap();
    let output = demo(folder.path(), &["--scene", "plane", "--samples", "5"]);
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{words}");
    assert!(words.contains("1, 4, 16 or 64"), "{words}");
}
