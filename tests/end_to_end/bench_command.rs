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
    assert!(output.stderr.is_empty(), "silent in a pipe");
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
    // Rendering a frame takes longer than copying its bytes, and a geometry pass takes time.
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
