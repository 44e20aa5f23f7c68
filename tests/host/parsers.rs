//! Runs every parser on its seeds, on truncated seeds and on mutations of them. The mutations are
//! the same in each run; `PHASMID_FUZZ_CASES=FIRST..END` selects others. `tests/fuzz` runs the same
//! functions for an unlimited time.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

#[path = "../fuzz/src/parsers/mod.rs"]
mod fuzzed;

use crate::cases;
use fuzzed::{PARSERS, Parser};

/// Number of mutated cases for each parser.
const CASES: u64 = 1500;
/// Number of truncations of each seed file.
const CUTS: usize = 200;
/// Maximum time of a case, on a loaded machine.
const LONGEST: Duration = Duration::from_secs(5);

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .unwrap_or_else(|e| panic!("{}: {e}", folder.display()))
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_file())
        .collect();
    files.sort();
    files
}

/// Returns the seeds of a parser, which are inputs that it accepts.
fn corpus(parser: &Parser) -> Vec<Vec<u8>> {
    let mut paths = Vec::new();
    let own = root().join("tests/fuzz/seeds").join(parser.name);
    if own.is_dir() || parser.shipped.is_none() {
        paths.extend(files(&own));
    }
    if let Some((folder, extension)) = parser.shipped {
        let shipped = files(&root().join(folder));
        paths.extend(
            shipped
                .into_iter()
                .filter(|path| path.extension().is_some_and(|e| e == extension)),
        );
    }
    assert!(!paths.is_empty(), "{} has seeds", parser.name);
    paths
        .iter()
        .map(|path| std::fs::read(path).unwrap())
        .collect()
}

fn run(parser: &Parser, bytes: &[u8]) -> bool {
    let begin = Instant::now();
    let known = (parser.run)(bytes);
    let took = begin.elapsed();
    assert!(took < LONGEST, "{}: {took:?} for {bytes:?}", parser.name);
    known
}

fn throw_at(name: &str) {
    let parser = PARSERS.iter().find(|parser| parser.name == name).unwrap();
    let seeds = corpus(parser);
    let mut known = 0;
    for seed in &seeds {
        known += usize::from(run(parser, seed));
        for at in (0..seed.len()).step_by(seed.len() / CUTS + 1) {
            run(parser, &seed[..at]);
        }
    }
    assert!(
        2 * known >= seeds.len(),
        "{name}: {known} of {} are read",
        seeds.len()
    );
    cases::each(CASES, &seeds, |bytes| {
        run(parser, bytes);
    });
}

macro_rules! parsers {
    ($($name:ident),* $(,)?) => {
        $(#[test]
        fn $name() {
            throw_at(stringify!($name));
        })*

        #[test]
        fn every_parser_has_a_test_and_a_target() {
            let tested = [$(stringify!($name)),*];
            let listed: Vec<_> = PARSERS.iter().map(|parser| parser.name).collect();
            assert_eq!(tested[..], listed[..]);
            for name in tested {
                fuzzed::run(name, b"");
                let target = root().join(format!("tests/fuzz/targets/{name}.rs"));
                let text = std::fs::read_to_string(&target).unwrap();
                assert!(text.contains(&format!("run(\"{name}\", bytes)")), "{name}");
                let cargo = std::fs::read_to_string(root().join("tests/fuzz/Cargo.toml")).unwrap();
                assert!(cargo.contains(&format!("name = \"{name}\"")), "{name}");
            }
        }
    };
}

parsers!(
    scpi,
    firmware,
    service,
    frames,
    data_line,
    usb_records,
    recording,
    usb_address,
    manifest,
    rig,
    endpoints,
    profile,
    station,
    dialect,
    dialect_wire,
    faults,
    scene,
    patient,
    stl,
    obj,
    ply,
    image,
    metaimage,
    dicom,
    planning,
);
