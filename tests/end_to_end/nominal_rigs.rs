//! Checks that the nominal rigs in `src/geometry/nominal`, which serve as test data for modules
//! that do not load profiles, equal the rigs of the built-in profiles.

use phasmid::profile::{Profile, profile_names};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// Compares all files of the folder with the profiles. With `PHASMID_BLESS=1` in the environment,
/// rewrites the files.
#[test]
fn the_nominal_rigs_are_those_of_the_profiles() {
    let mut wanted = BTreeMap::new();
    let mut board_scales = String::new();
    for name in profile_names() {
        let profile = Profile::load(name).unwrap();
        wanted.insert(format!("{name}.toml"), profile.nominal_rig().to_toml());
        let scale = profile.calibration.board_scale.unwrap();
        writeln!(board_scales, "{name} = {scale:?}").unwrap();
    }
    wanted.insert("board_scales.toml".to_owned(), board_scales);

    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/geometry/nominal");
    if std::env::var("PHASMID_BLESS").is_ok_and(|v| v == "1") {
        for (name, text) in &wanted {
            fs::write(folder.join(name), text).unwrap();
        }
    }
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "toml") {
            let name = path.file_name().unwrap().to_str().unwrap().to_owned();
            found.insert(name, fs::read_to_string(&path).unwrap());
        }
    }
    assert!(found.keys().eq(wanted.keys()), "{:?}", found.keys());
    for (name, wanted) in &wanted {
        assert_eq!(&found[name], wanted, "{name}");
    }
}
