//! A page for each crate, generated from its manifest and its crate documentation, and the page of
//! dependencies.

use super::{root, text};
use std::fmt::Write;
use std::path::Path;

/// Returns the crate documentation in `lib.rs`, with headings one level lower and links to items
/// replaced by code.
fn documentation(folder: &Path) -> String {
    let mut out = String::new();
    let source = text(&folder.join("lib.rs"));
    for line in source.lines().map_while(|line| line.strip_prefix("//!")) {
        let line = line.strip_prefix(' ').unwrap_or(line);
        let heading = if line.starts_with('#') { "#" } else { "" };
        writeln!(out, "{heading}{}", without_links(line)).unwrap();
    }
    out
}

/// Replaces `` [`item`] `` and `` [`item`](path) `` by `` `item` ``.
fn without_links(line: &str) -> String {
    let mut out = String::new();
    let mut rest = line;
    while let Some((before, after)) = rest.split_once("[`") {
        let Some((item, after)) = after.split_once("`]") else {
            break;
        };
        write!(out, "{before}`{item}`").unwrap();
        rest = match after
            .strip_prefix('(')
            .and_then(|rest| rest.split_once(')'))
        {
            Some((_, rest)) => rest,
            None => after,
        };
    }
    out + rest
}

/// Returns the dependencies in a manifest's table: first workspace crates, then others.
fn dependencies(manifest: &toml::Table) -> [Vec<&str>; 2] {
    let table = manifest.get("dependencies").and_then(toml::Value::as_table);
    let names = table.into_iter().flat_map(|table| table.keys());
    names
        .map(String::as_str)
        .partition::<Vec<_>, _>(|name| name.starts_with("phasmid-"))
        .into()
}

#[test]
fn every_crate_has_its_page() {
    let workspace: toml::Table = text(Path::new("Cargo.toml")).parse().unwrap();
    let members = workspace["workspace"]["members"].as_array().unwrap();
    let members = members.iter().map(|member| member.as_str().unwrap());
    // Python's bindings have a page of their own.
    let members: Vec<&str> = members.filter(|member| *member != "python").collect();
    for member in &members {
        let folder = Path::new(member);
        let manifest: toml::Table = text(&folder.join("Cargo.toml")).parse().unwrap();
        let package = &manifest["package"];
        let name = folder.file_name().unwrap().to_str().unwrap();
        let list = |names: &[&str]| match names {
            [] => "none".to_owned(),
            names => names
                .iter()
                .map(|name| format!("`{name}`"))
                .collect::<Vec<_>>()
                .join(", "),
        };
        let [ours, others] = dependencies(&manifest);
        let page = format!(
            "# {name}\n\n`{}` in `{}`. Crates of the workspace that it uses: {}. Other crates: {}.\n\n{}",
            package["name"].as_str().unwrap(),
            folder.display(),
            list(&ours),
            list(&others),
            documentation(folder)
        );
        super::assert_generated(&format!("inside/crates/{name}.md"), &page);
    }
    let count = std::fs::read_dir(root().join("docs/src/inside/crates"))
        .unwrap()
        .count();
    assert_eq!(
        count,
        members.len(),
        "a page of a crate that no longer exists"
    );
}

/// Returns the direct dependencies of a manifest with the comments above them: name, reason.
fn reasons(manifest: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    let mut reason = String::new();
    let mut inside = false;
    for line in text(Path::new(manifest)).lines() {
        if line.starts_with('[') {
            inside = line.ends_with("dependencies]");
            reason.clear();
        } else if let Some(comment) = line.strip_prefix("# ") {
            reason = format!("{reason} {comment}").trim().to_owned();
        } else {
            let name = line.split(['.', ' ']).next().unwrap_or("");
            if inside && !reason.is_empty() && !name.starts_with("phasmid-") {
                found.push((name.to_owned(), std::mem::take(&mut reason)));
            }
            reason.clear();
        }
    }
    found
}

#[test]
fn every_dependency_has_its_reason() {
    let manifest: toml::Table = text(Path::new("Cargo.toml")).parse().unwrap();
    let found = reasons("Cargo.toml");
    let shared = manifest["workspace"]["dependencies"].as_table().unwrap();
    for name in shared.keys().filter(|name| !name.starts_with("phasmid-")) {
        assert!(
            found.iter().any(|(known, _)| known == name),
            "{name}: no comment"
        );
    }
    let mut page = String::from(
        "# Dependencies\n\nThis page is generated from the comments in `Cargo.toml`. No dependency needs libclang, libudev or a GPU driver to build.\n\n| crate | reason |\n| --- | --- |\n",
    );
    for (name, reason) in found {
        writeln!(page, "| `{name}` | {reason} |").unwrap();
    }
    super::assert_generated("dependencies.md", &page);
}
