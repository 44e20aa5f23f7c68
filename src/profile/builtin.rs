//! Profiles, stations and scenes that ship inside the program.

use super::source::{self, TomlSource};
use crate::error::Result;
use std::path::PathBuf;

/// Name and text of each profile.
const PROFILES: [(&str, &str); 5] = [
    (
        "dlp-evm",
        include_str!("../../device-profiles/dlp-evm.toml"),
    ),
    (
        "pmp-bench",
        include_str!("../../device-profiles/pmp-bench.toml"),
    ),
    (
        "pmp-real",
        include_str!("../../device-profiles/pmp-real.toml"),
    ),
    (
        "sgrt-pod",
        include_str!("../../device-profiles/sgrt-pod.toml"),
    ),
    (
        "webcam-grey",
        include_str!("../../device-profiles/webcam-grey.toml"),
    ),
];

/// Name and text of each station.
const STATIONS: [(&str, &str); 2] = [
    (
        "two-pods",
        include_str!("../../device-profiles/stations/two-pods.toml"),
    ),
    (
        "sgrt-ceiling",
        include_str!("../../device-profiles/stations/sgrt-ceiling.toml"),
    ),
];

/// Name and text of each scene.
const SCENES: [(&str, &str); 9] = [
    (
        "trapezoid",
        include_str!("../../device-profiles/scenes/trapezoid.toml"),
    ),
    (
        "couch",
        include_str!("../../device-profiles/scenes/couch.toml"),
    ),
    (
        "torso",
        include_str!("../../device-profiles/scenes/torso.toml"),
    ),
    (
        "plane",
        include_str!("../../device-profiles/scenes/plane.toml"),
    ),
    (
        "sphere",
        include_str!("../../device-profiles/scenes/sphere.toml"),
    ),
    (
        "board",
        include_str!("../../device-profiles/scenes/board.toml"),
    ),
    (
        "treatment-room",
        include_str!("../../device-profiles/scenes/treatment-room.toml"),
    ),
    (
        "treatment-room-head",
        include_str!("../../device-profiles/scenes/treatment-room-head.toml"),
    ),
    (
        "treatment-room-board",
        include_str!("../../device-profiles/scenes/treatment-room-board.toml"),
    ),
];

/// Names of the built-in profiles.
pub fn profile_names() -> impl Iterator<Item = &'static str> {
    PROFILES.iter().map(|(name, _)| *name)
}

/// Names of the built-in stations.
pub fn station_names() -> impl Iterator<Item = &'static str> {
    STATIONS.iter().map(|(name, _)| *name)
}

/// Names of the built-in scenes.
pub fn scene_names() -> impl Iterator<Item = &'static str> {
    SCENES.iter().map(|(name, _)| *name)
}

pub(super) fn profile_source(name_or_path: &str) -> Result<(TomlSource, PathBuf)> {
    source::load(name_or_path, &PROFILES, "profile")
}

/// A profile or a station.
pub(super) fn configuration_source(name_or_path: &str) -> Result<(TomlSource, PathBuf)> {
    let shipped = [&PROFILES[..], &STATIONS].concat();
    source::load(name_or_path, &shipped, "profile")
}

pub(super) fn scene_source(name_or_path: &str) -> Result<(TomlSource, PathBuf)> {
    source::load(name_or_path, &SCENES, "scene")
}
