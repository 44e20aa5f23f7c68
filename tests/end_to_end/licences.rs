//! Checks the dependencies' licences against the list in deny.toml.

use spdx::{Expression, ParseMode};
use std::process::Command;

/// Whether allowed licences satisfy an SPDX expression.
fn allowed(expression: &str, allow: &[String]) -> bool {
    let parsed = Expression::parse_mode(expression, ParseMode::LAX);
    let parsed = parsed.unwrap_or_else(|e| panic!("{expression:?}: {e}"));
    parsed.evaluate(|licence| allow.contains(&licence.to_string()))
}

fn allow_list() -> Vec<String> {
    let text = include_str!("../../deny.toml");
    let deny: toml::Table = toml::from_str(text).unwrap();
    let list = deny["licenses"]["allow"].as_array().unwrap();
    list.iter()
        .map(|l| l.as_str().unwrap().to_owned())
        .collect()
}

#[test]
fn every_dependency_has_an_allowed_licence() {
    // Only this platform's packages are certain to be on the machine.
    let rustc = Command::new("rustc").arg("-vV").output().unwrap();
    let version = String::from_utf8(rustc.stdout).unwrap();
    let host = version
        .lines()
        .find_map(|line| line.strip_prefix("host: "))
        .unwrap();
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked", "--offline"])
        .args(["--filter-platform", host])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let allow = allow_list();
    let packages = metadata["packages"].as_array().unwrap();
    assert!(packages.len() > 50);
    for package in packages {
        let licence = package["license"].as_str().unwrap_or("none");
        assert!(allowed(licence, &allow), "{}: {licence}", package["name"]);
        let source = package["source"].as_str().unwrap_or("here");
        let known = source == "here" || source.contains("crates.io");
        assert!(known, "{} comes from {source}", package["name"]);
    }
}

#[test]
fn expressions_are_read_as_spdx_has_them() {
    let allow = [
        "MIT".to_owned(),
        "Apache-2.0 WITH LLVM-exception".to_owned(),
    ];
    assert!(allowed("MIT OR GPL-3.0", &allow));
    assert!(!allowed("MIT AND GPL-3.0", &allow));
    assert!(allowed(
        "(GPL-3.0 OR MIT) AND Apache-2.0 WITH LLVM-exception",
        &allow
    ));
    assert!(!allowed("GPL-3.0", &allow));
}
