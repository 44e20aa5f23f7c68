//! Nominal rigs of the built-in devices, as test data for modules that do not load profiles.
//!
//! `tests/end_to_end/nominal_rigs.rs` compares the files with the profiles and, with `PHASMID_BLESS=1` in the
//! environment, writes them anew.

use super::Rig;
use std::collections::BTreeMap;

/// Name of each device, and its nominal rig as TOML.
const RIGS: [(&str, &str); 5] = [
    ("dlp-evm", include_str!("dlp-evm.toml")),
    ("pmp-bench", include_str!("pmp-bench.toml")),
    ("pmp-real", include_str!("pmp-real.toml")),
    ("sgrt-pod", include_str!("sgrt-pod.toml")),
    ("webcam-grey", include_str!("webcam-grey.toml")),
];

/// Scale of each device's calibration board, by the device's name.
const BOARD_SCALES: &str = include_str!("board_scales.toml");

/// Names of the built-in devices.
pub fn names() -> impl Iterator<Item = &'static str> {
    RIGS.iter().map(|(name, _)| *name)
}

/// Nominal rig of a device as TOML.
pub fn text(name: &str) -> &'static str {
    let found = RIGS.iter().find(|(known, _)| *known == name);
    found.unwrap_or_else(|| panic!("no device {name}")).1
}

/// Nominal rig of a device.
pub fn rig(name: &str) -> Rig {
    Rig::from_toml(text(name), name).unwrap()
}

/// Scale of the board of dots that a device is calibrated with.
pub fn board_scale(name: &str) -> f64 {
    board_scales()[name]
}

fn board_scales() -> BTreeMap<String, f64> {
    toml::from_str(BOARD_SCALES).unwrap()
}

/// The list of scales is generated from the profiles, the list of rigs is not.
#[test]
fn every_device_has_a_rig_and_a_board_scale() {
    assert!(names().eq(board_scales().into_keys()));
}
