//! The book's page about the service channel lists the maps and flags of the ground truth.

use super::text;
use phasmid::emulator::Truth;
use std::path::Path;

#[test]
fn flags_of_the_truth_are_those_of_the_source() {
    let page = text(Path::new("docs/src/reference/service.md"));
    let (_, section) = page.split_once("\n## Flags of the truth\n").unwrap();
    let rows: Vec<Vec<&str>> = section
        .lines()
        .filter(|line| line.starts_with("| ") && line.contains('`'))
        .map(|line| line.split('|').map(str::trim).skip(1).take(3).collect())
        .collect();
    let flags = [
        ("`SEEN`", Truth::SEEN),
        ("`LIT`", Truth::LIT),
        ("`SQUARE`", Truth::SQUARE),
        ("`CREASE`", Truth::CREASE),
        ("`SATURATED`", Truth::SATURATED),
        ("`UNRESOLVED`", Truth::UNRESOLVED),
        ("`MOVING`", Truth::MOVING),
    ];
    let wanted = flags.map(|(name, value)| {
        let bit = value.trailing_zeros().to_string();
        vec![bit, value.to_string(), name.to_owned()]
    });
    assert_eq!(rows, wanted);
}

#[test]
fn maps_of_the_truth_are_those_of_the_source() {
    let page = text(Path::new("docs/src/reference/service.md"));
    let (_, section) = page.split_once("\n## Maps of the truth\n").unwrap();
    let (section, _) = section.split_once("\n## ").unwrap();
    let names: Vec<&str> = section
        .lines()
        .filter_map(|line| line.strip_prefix("| `")?.split_once('`'))
        .map(|(name, _)| name)
        .collect();
    assert_eq!(names, Truth::MAPS);
}
