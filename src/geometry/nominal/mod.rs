//! Nominal rigs of the built-in devices, as test data for modules that do not load profiles.
//!
//! `tests/end_to_end/nominal_rigs.rs` compares the files with the profiles and rewrites them if
//! `PHASMID_BLESS=1` is set in the environment.

use super::Rig;
use std::collections::BTreeMap;

/// Name and nominal rig (TOML) of each device.
const RIGS: [(&str, &str); 5] = [
    ("dlp-evm", include_str!("dlp-evm.toml")),
    ("pmp-bench", include_str!("pmp-bench.toml")),
    ("pmp-real", include_str!("pmp-real.toml")),
    ("sgrt-pod", include_str!("sgrt-pod.toml")),
    ("webcam-grey", include_str!("webcam-grey.toml")),
];

/// Scale factor of each device's calibration board, by device name.
const BOARD_SCALES: &str = include_str!("board_scales.toml");

/// Returns the names of the built-in devices.
pub fn names() -> impl Iterator<Item = &'static str> {
    RIGS.iter().map(|(name, _)| *name)
}

/// Returns the nominal rig of a device as TOML. Panics if the name is unknown.
pub fn text(name: &str) -> &'static str {
    let found = RIGS.iter().find(|(known, _)| *known == name);
    found.unwrap_or_else(|| panic!("no device {name}")).1
}

/// Returns the nominal rig of a device. Panics if the name is unknown.
pub fn rig(name: &str) -> Rig {
    Rig::from_toml(text(name), name).unwrap()
}

/// Returns the scale factor of the dot board with which a device is calibrated.
pub fn board_scale(name: &str) -> f64 {
    board_scales()[name]
}

fn board_scales() -> BTreeMap<String, f64> {
    toml::from_str(BOARD_SCALES).unwrap()
}

/// The list of scales is generated from the profiles; the list of rigs is not.
#[test]
fn every_device_has_a_rig_and_a_board_scale() {
    assert!(names().eq(board_scales().into_keys()));
}
