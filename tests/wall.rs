//! The wall between the device's half and the host's half: neither imports the other.

use std::path::{Path, PathBuf};

const DEVICE: [&str; 2] = ["emulator", "link"];
const HOST: [&str; 4] = ["host", "decode", "calibrate", "measure"];
const GROUND: [&str; 6] = [
    "geometry", "patient", "pattern", "profile", "protocol", "v4l2",
];
const TOP: [&str; 3] = ["study", "cli", "doctor"];

fn sources(module: &str) -> Vec<(PathBuf, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("src")
        .join(module);
    let mut folders = vec![root];
    let mut found = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let text = std::fs::read_to_string(&path).unwrap();
                found.push((path, text));
            }
        }
    }
    assert!(!found.is_empty(), "no sources in {module}");
    found
}

/// Modules of the crate that a source names, by `crate::name` or inside `crate::{...}`.
fn imports(text: &str) -> Vec<String> {
    let code: String = text
        .lines()
        .map(|line| line.split("//").next().unwrap_or(""))
        .flat_map(|line| [line, "\n"])
        .collect();
    let mut names = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        let rest = &code[at + "crate::".len()..];
        if let Some(list) = rest.strip_prefix('{') {
            let mut depth = 0;
            let mut item = String::new();
            for c in list.chars() {
                match c {
                    '{' => depth += 1,
                    '}' if depth == 0 => break,
                    '}' => depth -= 1,
                    ',' if depth == 0 => names.push(std::mem::take(&mut item)),
                    c if depth == 0 => item.push(c),
                    _ => {}
                }
            }
            names.push(item);
        } else {
            names.push(rest.to_owned());
        }
    }
    let ident = |s: &String| -> String {
        let s = s.trim_start();
        s.chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect()
    };
    names.iter().map(ident).collect()
}

fn assert_apart(from: &[&str], forbidden: &[&str]) {
    for module in from {
        for (path, text) in sources(module) {
            for name in imports(&text) {
                assert!(
                    !forbidden.contains(&name.as_str()),
                    "{} imports crate::{name}",
                    path.display()
                );
            }
        }
    }
}

#[test]
fn neither_half_imports_the_other() {
    assert_apart(&DEVICE, &HOST);
    assert_apart(&HOST, &DEVICE);
}

#[test]
fn the_ground_stands_on_nothing_and_no_half_on_the_top() {
    assert_apart(&GROUND, &[&DEVICE[..], &HOST, &TOP].concat());
    assert_apart(&[&DEVICE[..], &HOST].concat(), &TOP);
}

#[test]
fn an_import_is_found_however_it_is_written() {
    let text =
        "use crate::{geometry::{A, B}, emulator::Shot};\nlet x = crate::link::y(); // crate::host";
    assert_eq!(imports(text), ["geometry", "emulator", "link"]);
}
