//! `phasmid bench`: frame rates.

use serde_json::Value;
use std::process::{Command, Output};

fn bench(options: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_phasmid"));
    command.args(["bench", "--profile", "webcam-grey", "--scene", "plane"]);
    command.args(["--frames", "4"]).args(options);
    // Makes the Vulkan loader find no driver.
    command.env("VK_DRIVER_FILES", "/nowhere.json");
    command.env("VK_ICD_FILENAMES", "/nowhere.json");
    command.output().unwrap()
}

fn json(options: &[&str]) -> Value {
    let output = bench(&[options, &["--json"]].concat());
    assert!(output.status.success());
    assert!(output.stderr.is_empty(), "no progress in a pipe");
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn bench_reports_figures_of_the_cpu() {
    let report = json(&["--backend", "cpu"]);
    assert_eq!(
        (&report["width"], &report["height"]),
        (&640.into(), &480.into())
    );
    assert_eq!(report["without_gpu"], Value::Null);
    let [run] = report["runs"].as_array().unwrap().as_slice() else {
        panic!("{report}");
    };
    assert_eq!(run["backend"], "cpu");
    assert_eq!(run["adapter"], Value::Null);
    let rate = |name: &str| run[name]["frames_per_s"].as_f64().unwrap();
    // Rendering a frame takes longer than copying its bytes, and the geometry pass of a moving scene
    // takes additional time.
    assert!(run["still"]["over_copy"].as_f64().unwrap() > 1.0, "{run}");
    assert!(
        rate("still") > rate("moving") && rate("moving") > 0.0,
        "{run}"
    );
    let passes = run["passes"].as_array().unwrap();
    let names: Vec<_> = passes.iter().map(|p| p["pass"].as_str().unwrap()).collect();
    assert_eq!(names, ["geometry", "exposure and sensor"]);
    for pass in passes {
        assert!(pass["us_per_frame"].as_f64().unwrap() > 1.0, "{pass}");
    }
}

#[test]
fn without_a_gpu_auto_reports_it_and_gpu_fails() {
    let report = json(&["--backend", "auto"]);
    let why = report["without_gpu"].as_str().unwrap();
    assert!(why.contains("no Vulkan adapter"), "{why}");
    assert_eq!(report["runs"].as_array().unwrap().len(), 1);
    let output = bench(&["--backend", "auto"]);
    let text = String::from_utf8(output.stdout).unwrap();
    for words in [
        "no gpu: ",
        "no Vulkan adapter",
        "still frames/s",
        "exposure and sensor",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let output = bench(&["--backend", "gpu"]);
    assert_eq!(output.status.code(), Some(1));
    let words = String::from_utf8(output.stderr).unwrap();
    assert!(words.contains("no Vulkan adapter"), "{words}");
    assert!(output.stdout.is_empty());
}

#[test]
fn decoding_is_timed_and_a_sequence_that_cannot_be_decoded_is_named() {
    let report = json(&["--backend", "cpu"]);
    let rows = report["decoding"].as_array().unwrap();
    let names: Vec<_> = rows.iter().map(|p| p["pass"].as_str().unwrap()).collect();
    assert_eq!(
        names,
        ["decoding to depths", "checks of the frames", "points"]
    );
    for row in rows {
        assert!(row["us_per_frame"].as_f64().unwrap() > 0.0, "{row}");
    }
    let white = r#"sequence=[{ name = "a", period_us = 40000, frame = [{ pattern = { kind = "white" } }] }]"#;
    let report = json(&["--backend", "cpu", "--set", white]);
    assert_eq!(report["decoding"].as_array().unwrap().len(), 0);
    let why = report["without_decoding"].as_str().unwrap();
    assert!(why.contains("expected"), "{why}");
}

#[test]
fn every_link_has_figures_or_a_reason() {
    let command = |options: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_phasmid"));
        command.args(["bench", "--links", "--frames", "22"]);
        command.args(options).output().unwrap()
    };
    let output = command(&["--json"]);
    assert!(output.status.success(), "{output:?}");
    let speeds: Value = serde_json::from_slice(&output.stdout).unwrap();
    // Bytes of 1138 x 489 pixels and of the data line.
    assert_eq!(speeds["frame_bytes"], 557_620);
    let copy_us = speeds["copy_us"].as_f64().unwrap();
    let links = speeds["links"].as_array().unwrap();
    assert_eq!(links.len(), 6);
    for link in links {
        let (name, figures) = (link["link"].as_str().unwrap(), &link["figures"]);
        if let Some(why) = link["lacks"].as_str() {
            let optional = ["pty and V4L2", "USB of the kernel"].contains(&name);
            assert!(optional || cfg!(not(target_os = "linux")), "{link}");
            assert!(why.len() > 10 && figures.is_null(), "{link}");
            continue;
        }
        let numbers = |name: &str| -> Vec<f64> {
            let values = figures[name].as_array().unwrap();
            values.iter().map(|v| v.as_f64().unwrap()).collect()
        };
        let (latency, rate) = (numbers("latency_us"), numbers("frames_per_s"));
        // No link is faster than a memory copy of its data.
        assert!(copy_us < latency[0] && latency.is_sorted(), "{link}");
        assert!(0.0 < rate[0] && rate.is_sorted(), "{link}");
        assert!(rate[2] < 1e6 / copy_us, "{link}");
        // Three runs of the sequence.
        assert_eq!(
            (&figures["triggers"], &figures["frames"]),
            (&66.into(), &66.into())
        );
        assert!(figures["lost"] == 0 || name == "pty and V4L2", "{link}");
    }
    let table = String::from_utf8(command(&[]).stdout).unwrap();
    assert!(
        table.contains("pty and frame socket") && table.contains("frames/s"),
        "{table}"
    );
    let refused = command(&["--scene", "plane"]);
    assert_eq!(refused.status.code(), Some(2));
}
