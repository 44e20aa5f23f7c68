//! Checks the dependencies' licences against the list in deny.toml.

use std::process::Command;

/// Whether allowed licences satisfy an SPDX expression of names, AND, OR and brackets.
fn allowed(expression: &str, allow: &[String]) -> bool {
    let spaced = expression
        .replace('(', " ( ")
        .replace(')', " ) ")
        .replace('/', " OR ");
    // "A WITH B" counts as one name.
    let joined = spaced.replace(" WITH ", "+WITH+");
    let tokens: Vec<String> = joined
        .split_whitespace()
        .map(|t| t.replace("+WITH+", " WITH "))
        .collect();
    let mut rest = tokens.as_slice();
    let ok = any(&mut rest, allow);
    assert!(rest.is_empty(), "cannot read the licence {expression:?}");
    ok
}

fn any(tokens: &mut &[String], allow: &[String]) -> bool {
    let mut ok = all(tokens, allow);
    while tokens.first().is_some_and(|t| t == "OR") {
        *tokens = &tokens[1..];
        ok |= all(tokens, allow);
    }
    ok
}

fn all(tokens: &mut &[String], allow: &[String]) -> bool {
    let mut ok = one(tokens, allow);
    while tokens.first().is_some_and(|t| t == "AND") {
        *tokens = &tokens[1..];
        ok &= one(tokens, allow);
    }
    ok
}

fn one(tokens: &mut &[String], allow: &[String]) -> bool {
    let Some((first, rest)) = tokens.split_first() else {
        return false;
    };
    *tokens = rest;
    if first != "(" {
        return allow.contains(first);
    }
    let ok = any(tokens, allow);
    assert_eq!(tokens.first().map(String::as_str), Some(")"));
    *tokens = &tokens[1..];
    ok
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
