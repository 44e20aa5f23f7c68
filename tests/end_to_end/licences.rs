//! Checks the dependencies' licences against the list in deny.toml.

use spdx::{Expression, ParseMode};
use std::collections::BTreeSet;
use std::process::Command;

/// Returns whether the allowed licences satisfy an SPDX expression.
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
    // `cargo metadata` would also ask for packages that only Python's bindings need, which may not be
    // on the machine.
    let output = Command::new(env!("CARGO"))
        .args([
            "tree",
            "--locked",
            "--offline",
            "--edges",
            "normal,build,dev",
        ])
        .args(["--prefix", "none", "--format", "{p}|{l}"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let allow = allow_list();
    let text = String::from_utf8(output.stdout).unwrap();
    let packages: BTreeSet<&str> = text
        .lines()
        .filter(|line| !line.is_empty())
        .map(|line| line.trim_end_matches(" (*)"))
        .collect();
    assert!(packages.len() > 50);
    for line in packages {
        let (package, licence) = line.split_once('|').unwrap();
        assert!(allowed(licence, &allow), "{package}: {licence}");
        // The version is followed, in parentheses, by a workspace member's folder, `proc-macro`, or
        // a source other than crates.io.
        let source = package.split_once(" (").map_or("", |(_, source)| source);
        let known = source.is_empty() || source.starts_with('/') || source == "proc-macro)";
        assert!(known, "{package}: expected it from crates.io");
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
