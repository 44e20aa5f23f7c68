//! `phasmid plan`: the terms that are computed, the reasons, and the cost of each term.

use phasmid::emulator::render::Term;
use serde_json::Value;
use std::process::Command;

/// Options for a small image, because each pass is timed.
const SMALL: [&str; 6] = [
    "--set",
    "camera.width_px=160",
    "--set",
    "camera.height_px=120",
    "--set",
    "camera.sensor_width_mm=0.9",
];

fn plan(options: &[&str]) -> std::process::Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_phasmid"));
    command.arg("plan").args(options).output().unwrap()
}

fn json(options: &[&str]) -> Value {
    let output = plan(&[options, &["--json"]].concat());
    assert!(output.status.success());
    assert!(output.stderr.is_empty(), "no progress in a pipe");
    serde_json::from_slice(&output.stdout).unwrap()
}

fn term<'a>(report: &'a Value, name: &str) -> &'a Value {
    let terms = report["terms"].as_array().unwrap();
    let term = terms.iter().find(|term| term["term"] == name);
    term.unwrap_or_else(|| panic!("no {name} in {report}"))
}

#[test]
fn plan_lists_every_term_with_reason_and_cost() {
    let options = ["--profile", "webcam-grey", "--scene", "plane"];
    let plane = json(&[&options[..], &SMALL].concat());
    assert_eq!(plane["pixels"], 160 * 120);
    assert_eq!(plane["triangles"], 0);
    let names: Vec<&str> = plane["terms"]
        .as_array()
        .unwrap()
        .iter()
        .map(|term| term["term"].as_str().unwrap())
        .collect();
    let all = Term::ALL.map(|term| term.to_string());
    assert_eq!(
        names,
        all.each_ref().map(String::as_str),
        "each term once, in order"
    );
    for term in plane["terms"].as_array().unwrap() {
        assert!(term["why"].as_str().unwrap().len() > 8, "{term}");
        assert!(term["ns_per_pixel"].as_f64().unwrap().is_finite(), "{term}");
    }
    for pass in plane["passes"].as_array().unwrap() {
        // No machine computes a pixel in a picosecond.
        assert!(pass["ns_per_pixel"].as_f64().unwrap() > 1e-3, "{pass}");
    }
    // Drawing random numbers for every pixel takes most of a frame's time, so its cost cannot be
    // zero.
    assert!(term(&plane, "noise")["ns_per_pixel"].as_f64().unwrap() > 0.0);
    assert_eq!(term(&plane, "shadows")["included"], false);
    assert_eq!(term(&plane, "footprint-x")["included"], true);
    assert_eq!(term(&plane, "footprint-y")["included"], false);
}

#[test]
fn profile_and_scene_decide_which_terms_are_included() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("bent.toml");
    let text = include_str!("../../device-profiles/webcam-grey.toml");
    let bent = text.replace(
        "f_number",
        "distortion = [-0.1, 0.0, 0.0, 0.0, 0.0]\nf_number",
    );
    std::fs::write(&path, bent).unwrap();
    let options = ["--profile", path.to_str().unwrap(), "--scene", "trapezoid"];
    let report = json(&[&options[..], &SMALL].concat());
    assert_eq!(term(&report, "camera-distortion")["included"], true);
    assert_eq!(term(&report, "projector-distortion")["included"], false);
    assert_eq!(term(&report, "shadows")["included"], true);
}

#[test]
fn plan_prints_a_table_and_refuses_bad_arguments() {
    let options = ["--profile", "webcam-grey", "--scene", "plane"];
    let output = plan(&[&options[..], &SMALL].concat());
    let text = String::from_utf8(output.stdout).unwrap();
    for words in [
        "geometry",
        "camera.distortion is zero",
        "ns/px",
        "some pattern varies along x",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let output = plan(&["--samples", "5"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("1, 4, 16 or 64"));
    let output = plan(&["--scene", "no-such"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("no-such"));
}

#[test]
fn plan_names_the_fastest_setting_for_an_accuracy() {
    let with = |accuracy: &'static str| {
        let options = ["--profile", "webcam-grey", "--scene", "sphere"];
        [&options[..], &SMALL, &["--accuracy", accuracy]].concat()
    };
    let output = plan(&[&with("0.1mm")[..], &["--json"]].concat());
    assert!(output.status.success(), "{output:?}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    // A setting with which the scan finds no points has no error.
    let number = |row: &Value, name: &str| row[name].as_f64().unwrap_or(f64::NAN);
    let total = |row: &Value| number(row, "render_ms") + number(row, "decode_ms");
    let best = &report["cheapest"];
    assert!(number(best, "rmse_mm") <= 0.1, "{best}");
    let rows = report["settings"].as_array().unwrap();
    assert!(rows.len() > 15 && report["failed"].as_array().unwrap().is_empty());
    for row in rows {
        let reaches = number(row, "rmse_mm") <= 0.1
            && number(row, "coverage") >= 0.9
            && number(row, "gross_error_rate") <= 0.01;
        assert!(!reaches || total(row) >= total(best), "{row}");
    }
    assert!(rows.iter().any(|row| row["front"] == true));
    let text = String::from_utf8(plan(&with("0.1um")).stdout).unwrap();
    assert!(
        text.ends_with("\n0.000100 mm: no setting reaches it\n"),
        "{text}"
    );
    let refused = plan(&["--accuracy", "far"]);
    let words = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(2));
    assert!(words.contains("expected a length such as 0.1mm"), "{words}");
}
