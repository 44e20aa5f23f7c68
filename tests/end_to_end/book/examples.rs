//! Checks that the TOML examples of the README and the book parse.

use super::{Block, blocks, pages};
use phasmid::pattern::Manifest;
use phasmid::profile::{Profile, Scene, Station};
use phasmid::protocol::dialect::Dialect;
use std::path::Path;

/// Writes the values of one table into another, table by table.
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

/// Returns `pmp-bench` with the values of an example.
fn profile(example: &str, place: &str) -> Profile {
    let bench = include_str!("../../../device-profiles/pmp-bench.toml");
    let mut table: toml::Table = bench.parse().unwrap();
    overlay(&mut table, example.parse().unwrap());
    Profile::parse(&table.to_string(), place).unwrap()
}

/// Parses an example as the kind of file from which it is an excerpt.
fn check(block: &Block, place: &str) {
    match block.info.get(1).map(String::as_str) {
        Some("profile") => drop(profile(&block.text, place)),
        Some("scene") => {
            let mut table: toml::Table = "name = 's'\ndescription = ''".parse().unwrap();
            overlay(&mut table, block.text.parse().unwrap());
            drop(Scene::parse(&table.to_string(), place).unwrap());
        }
        Some("station") => drop(Station::parse(&block.text, place).unwrap()),
        Some("dialect") => drop(Dialect::parse(&block.text, place).unwrap()),
        Some("manifest") => drop(Manifest::parse(&block.text, place).unwrap()),
        _ => assert!(
            block.file().is_some(),
            "{place}: a toml block that is neither a file nor a part of one: {:?}",
            block.info
        ),
    }
}

#[test]
fn toml_examples_parse() {
    let mut count = 0;
    for page in pages() {
        for block in blocks(&page)
            .iter()
            .filter(|block| block.language() == "toml")
        {
            check(block, &page.display().to_string());
            count += 1;
        }
    }
    assert!(count > 0);
}

#[test]
fn the_effects_in_the_book_add_their_terms_to_the_plan() {
    let page = Path::new("docs/src/guides/own-scanner.md");
    let blocks = blocks(page);
    let effects = blocks
        .iter()
        .find(|block| block.text.contains("glare"))
        .unwrap();
    let profile = profile(&effects.text, "own-scanner.md");
    let scene = Scene::load("plane").unwrap();
    let renderer = phasmid::emulator::Renderer::new(&profile, &scene, 1).unwrap();
    let out: Vec<String> = renderer
        .decisions()
        .iter()
        .filter(|decision| !decision.included)
        .map(|decision| decision.term.to_string())
        .collect();
    // Terms that the example does not set, and terms that depend on the pattern images.
    let expected = [
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
    assert_eq!(out, expected);
}
