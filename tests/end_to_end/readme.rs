//! Every command of the README runs, in the order in which a reader meets them; its figures are those
//! of studies and commands (`figures`).

mod figures;

use std::path::Path;
use std::process::Command;
use tempfile::tempdir;

/// The fenced blocks of one language, in order.
fn blocks<'a>(text: &'a str, language: &str) -> Vec<&'a str> {
    let fence = format!("```{language}\n");
    text.split(&fence)
        .skip(1)
        .map(|rest| rest.split("```").next().unwrap())
        .collect()
}

#[test]
fn every_command_runs() {
    let readme = include_str!("../../README.md");
    let folder = tempdir().unwrap();
    let scene = blocks(readme, "toml")
        .into_iter()
        .find(|block| block.contains("[[object]]"))
        .unwrap();
    std::fs::write(folder.path().join("mine.toml"), scene).unwrap();
    let faults = blocks(readme, "toml")
        .into_iter()
        .find(|block| block.contains("[[fault]]"))
        .unwrap();
    std::fs::write(folder.path().join("bad-day.toml"), faults).unwrap();
    let shell = blocks(readme, "sh");
    assert!(shell.len() >= 6);
    // `cargo run --release --` is the program that cargo has built for this test.
    let prelude = "set -eu\n\
        cargo() { [ \"$1 $2 $3\" = 'run --release --' ]; shift 3; phasmid \"$@\"; }\n\
        trap 'kill $(jobs -p) 2> /dev/null; wait' EXIT\n";
    let script = format!("{prelude}{}", shell.join("\n"));
    let program = Path::new(env!("CARGO_BIN_EXE_phasmid")).parent().unwrap();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
    let output = Command::new("bash")
        .arg("-c")
        .arg(&script)
        .env("PATH", path)
        .current_dir(folder.path())
        .output()
        .unwrap();
    let (out, err) = (
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr),
    );
    assert!(output.status.success(), "{out}\n{err}");
    assert!(
        out.contains("Phasmid,webcam-grey,0001,0.1.0;0,\"No error\""),
        "{out}"
    );
    for file in [
        "phasmid-demo/overview.png",
        "scan/frame_00.png",
        "scan/cloud.ply",
        "rec-scan/cloud.ply",
        "replay-scan/cloud.ply",
        "room-left/cloud.ply",
        "decoded/projector_x.npy",
        "decoded/cloud.ply",
        "mine/summary.json",
        "calibrated/report.html",
        "calibrated/truth.json",
        "from-captures/calibration.yml",
        "dots.svg",
        "chess.svg",
        "planning/dvf_90.mha",
        "track.csv",
        "located.toml",
        "imported/dvf_50.mha",
    ] {
        assert!(folder.path().join(file).is_file(), "{file}\n{out}");
    }
    assert!(
        !folder.path().join("run/device.json").exists(),
        "serve has cleaned up"
    );
}

#[test]
fn the_manifest_in_the_readme_reads() {
    let readme = include_str!("../../README.md");
    let examples = blocks(readme, "toml");
    let of = |words: &str| *examples.iter().find(|text| text.contains(words)).unwrap();
    let manifest = of("[[frame]]");
    assert_eq!(
        phasmid::pattern::Manifest::parse(manifest, "README")
            .unwrap()
            .frame
            .len(),
        3
    );
    let scene = format!("name = \"s\"\ndescription = \"\"\n{}", of("motion = {"));
    let scene = phasmid::profile::Scene::parse(&scene, "README").unwrap();
    assert!(scene.object[0].motion.is_some() && scene.object[0].deform.is_some());
    let bench = include_str!("../../device-profiles/pmp-bench.toml");
    let without = bench.replace(
        "[calibration]\nsequence = \"pmp-12-xy\"\nboard_scale = 4.0\n",
        "",
    );
    let profile = format!("{without}\n{}", of("[calibration]"));
    let calibration = phasmid::profile::Profile::parse(&profile, "README")
        .unwrap()
        .calibration;
    assert_eq!(calibration.distance_mm, Some(1000.0));
    let profile = format!("{bench}\n{}", of("[usb]"));
    let usb = phasmid::profile::Profile::parse(&profile, "README")
        .unwrap()
        .usb;
    assert_ne!(usb, phasmid::profile::Usb::default());
    let profile = format!("{bench}\n{}\n{}", of("[control]"), of("[projector.led]"));
    let profile = phasmid::profile::Profile::parse(&profile, "README").unwrap();
    assert_eq!(profile.control.dialect, "okline");
    assert_eq!(profile.projector.led.unwrap().droop.len(), 2);
}

#[test]
fn a_board_is_a_shape() {
    let readme = include_str!("../../README.md");
    let examples = blocks(readme, "toml");
    let board = examples.iter().find(|text| text.contains("chess"));
    let text = format!("name = \"s\"\ndescription = \"\"\n{}", board.unwrap());
    let scene = phasmid::profile::Scene::parse(&text, "README").unwrap();
    assert!(matches!(
        scene.object[0].shape,
        phasmid::profile::Shape::Board { .. }
    ));
}

#[test]
fn skin_is_a_scene_s() {
    let readme = include_str!("../../README.md");
    let examples = blocks(readme, "toml");
    let skin = examples.iter().find(|text| text.contains("fitzpatrick"));
    let text = format!("name = \"s\"\ndescription = \"\"\n{}", skin.unwrap());
    let scene = phasmid::profile::Scene::parse(&text, "README").unwrap();
    assert_eq!(scene.object[0].skin.unwrap().fitzpatrick, Some(2));
}

/// Puts a table's values over another's, table by table.
fn overlay(base: &mut toml::Table, over: toml::Table) {
    for (key, value) in over {
        match (base.get_mut(&key), value) {
            (Some(toml::Value::Table(base)), toml::Value::Table(over)) => overlay(base, over),
            (_, value) => {
                base.insert(key, value);
            }
        }
    }
}

#[test]
fn what_cameras_and_projectors_do_is_in_the_plan() {
    let readme = include_str!("../../README.md");
    let examples = blocks(readme, "toml");
    let effects = examples.iter().find(|text| text.contains("glare")).unwrap();
    let mut profile: toml::Table = include_str!("../../device-profiles/pmp-bench.toml")
        .parse()
        .unwrap();
    overlay(&mut profile, effects.parse().unwrap());
    let profile = phasmid::profile::Profile::parse(&profile.to_string(), "README").unwrap();
    let scene = phasmid::profile::Scene::load("plane").unwrap();
    let renderer = phasmid::emulator::Renderer::new(&profile, &scene, 1).unwrap();
    let out: Vec<String> = renderer
        .decisions()
        .iter()
        .filter(|decision| !decision.included)
        .map(|decision| decision.term.to_string())
        .collect();
    // What the block does not speak of, and what slides decide.
    let wanted = [
        "camera-distortion",
        "projector-distortion",
        "shadows",
        "albedo-maps",
        "specular",
        "lights",
        "subsurface",
        "interreflection",
        "footprint-x",
        "footprint-y",
        "motion",
        "flicker",
        "pattern-timing",
    ];
    assert_eq!(out, wanted);
}
