//! Runs a study in the test's process and compares it with its snapshot.

use phasmid::study::ALL;
use phasmid::study::lab::{Settings, Surroundings, run};
use std::fs;
use std::path::Path;
use std::time::Instant;

/// Checks the quick form, which takes less than a minute; its snapshot is
/// `tests/studies/NAME.quick.md`.
pub fn quick(name: &str) {
    held(name, true);
}

/// Checks the full form; its snapshot is `tests/studies/NAME.md`.
pub fn whole(name: &str) {
    held(name, false);
}

/// Runs a study with seed 1 in a new folder, compares its tables (except times) with the snapshot,
/// and asserts that all its checks have passed. With `PHASMID_BLESS=1` in the environment, rewrites
/// the snapshot.
fn held(name: &str, quick: bool) {
    let study = *ALL.iter().find(|study| study.name() == name).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let begin = Instant::now();
    let around = Surroundings {
        clock: &|| begin.elapsed(),
        jobs: 1,
        revision: "test",
    };
    let settings = Settings {
        quick,
        seed: 1,
        only: None,
    };
    let document = run(study, folder.path(), &settings, &around, &|_, _, _| {}).unwrap();
    println!("{name}: {:.1} s", begin.elapsed().as_secs_f64());
    let found = document.markdown(false);
    let form = if quick { ".quick" } else { "" };
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let path = root.join(format!("tests/studies/{name}{form}.md"));
    if std::env::var("PHASMID_BLESS").is_ok_and(|v| v == "1") {
        fs::write(&path, &found).unwrap();
    }
    let failed: Vec<_> = document.checks().filter(|check| !check.passed()).collect();
    assert!(failed.is_empty(), "{failed:#?}");
    assert!(document.checks().count() > 0, "nothing is checked");
    let wanted = fs::read_to_string(&path).unwrap();
    for (i, (found, wanted)) in found.lines().zip(wanted.lines()).enumerate() {
        assert_eq!(found, wanted, "{}, line {}", path.display(), i + 1);
    }
    let [found, wanted] = [found, wanted].map(|text| text.lines().count());
    assert_eq!(found, wanted, "lines of {}", path.display());
}
