//! Built-in profiles, stations and scenes.

use phasmid_core::error::{Error, Result};
use phasmid_core::source::{self, TomlSource};
use std::path::{Path, PathBuf};

/// Name and text of each profile.
const PROFILES: [(&str, &str); 5] = [
    ("dlp-evm", phasmid_device_profiles::DLP_EVM),
    ("pmp-bench", phasmid_device_profiles::PMP_BENCH),
    ("pmp-real", phasmid_device_profiles::PMP_REAL),
    ("sgrt-pod", phasmid_device_profiles::SGRT_POD),
    ("webcam-grey", phasmid_device_profiles::WEBCAM_GREY),
];

/// Name and text of each station.
const STATIONS: [(&str, &str); 2] = [
    ("two-pods", phasmid_device_profiles::STATIONS_TWO_PODS),
    (
        "sgrt-ceiling",
        phasmid_device_profiles::STATIONS_SGRT_CEILING,
    ),
];

/// Name and text of each scene.
pub(super) const SCENES: [(&str, &str); 9] = [
    ("trapezoid", phasmid_device_profiles::SCENES_TRAPEZOID),
    ("couch", phasmid_device_profiles::SCENES_COUCH),
    ("torso", phasmid_device_profiles::SCENES_TORSO),
    ("plane", phasmid_device_profiles::SCENES_PLANE),
    ("sphere", phasmid_device_profiles::SCENES_SPHERE),
    ("board", phasmid_device_profiles::SCENES_BOARD),
    (
        "treatment-room",
        phasmid_device_profiles::SCENES_TREATMENT_ROOM,
    ),
    (
        "treatment-room-head",
        phasmid_device_profiles::SCENES_TREATMENT_ROOM_HEAD,
    ),
    (
        "treatment-room-board",
        phasmid_device_profiles::SCENES_TREATMENT_ROOM_BOARD,
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

/// Returns the TOML of a built-in profile or station; `None` for any other name.
pub fn profile_text(name: &str) -> Option<&'static str> {
    text(&PROFILES, name).or_else(|| text(&STATIONS, name))
}

/// Returns the TOML of a built-in scene; `None` for any other name.
pub fn scene_text(name: &str) -> Option<&'static str> {
    text(&SCENES, name)
}

fn text(documents: &[(&str, &'static str)], name: &str) -> Option<&'static str> {
    let (_, text) = documents.iter().find(|(known, _)| *known == name)?;
    Some(text)
}

/// Loads the TOML of a built-in profile, or of a file.
pub(super) fn profile_source(name_or_path: &str) -> Result<(TomlSource, PathBuf)> {
    let station = |source: &TomlSource| source.has("device") && !source.has("camera");
    let is_station = STATIONS.iter().any(|(name, _)| *name == name_or_path);
    match source::load(name_or_path, &PROFILES, "profile") {
        Ok((source, _)) if station(&source) => Err(refused_station(name_or_path)),
        Err(_) if is_station => Err(refused_station(name_or_path)),
        found => found,
    }
}

fn refused_station(name_or_path: &str) -> Error {
    let names: Vec<&str> = profile_names().collect();
    Error::input(
        format!("profile {name_or_path:?}"),
        "a station, which lists several devices",
        format!(
            "the profile of one device: {} or a TOML file",
            names.join(", ")
        ),
    )
}

/// Loads the TOML of a built-in profile or station, or of a file.
pub(super) fn configuration_source(name_or_path: &str) -> Result<(TomlSource, PathBuf)> {
    let shipped = [&PROFILES[..], &STATIONS].concat();
    source::load(name_or_path, &shipped, "profile")
}

/// Merges the documents that a profile extends into it. Their paths are relative to `folder`.
pub(super) fn extended_profile(source: TomlSource, folder: &Path) -> Result<TomlSource> {
    source.extended(folder, &PROFILES, "profile")
}

/// Merges the documents that a scene extends into it. Their paths are relative to `folder`.
pub(super) fn extended_scene(source: TomlSource, folder: &Path) -> Result<TomlSource> {
    source.extended(folder, &SCENES, "scene")
}

pub(super) fn scene_source(name_or_path: &str) -> Result<(TomlSource, PathBuf)> {
    source::load(name_or_path, &SCENES, "scene")
}

#[cfg(test)]
mod tests {
    use crate::{Configuration, Profile};
    use glam::{DVec3, Vec3};
    use phasmid_geometry::Pose;
    use phasmid_geometry::raycast::{Bvh, LANES, Packet, Scratch};
    use phasmid_geometry::shapes::linac_head;

    /// Returns whether the linac head, at a gantry angle in degrees, blocks the line of sight from the
    /// isocentre to `place` (mm).
    fn hides(gantry_deg: f64, place: DVec3) -> bool {
        let gantry = Pose::from_xyz_deg(DVec3::ZERO, DVec3::new(0.0, gantry_deg, 0.0));
        let mesh = linac_head();
        let vertices: Vec<DVec3> = mesh.vertices.iter().map(|v| gantry.point(*v)).collect();
        let bvh = Bvh::build(&vertices, &mesh.triangles);
        let mut ends = [-1.0; LANES];
        ends[0] = 1.0;
        let mut packet = Packet::new(Vec3::ZERO, &[place.as_vec3(); LANES], &ends);
        bvh.blocked(&mut packet, &mut Scratch::default());
        packet.t[0] < 0.0
    }

    #[test]
    fn pods_are_hidden_from_the_isocentre_at_some_gantry_angles() {
        let Configuration::Station(station) = Configuration::load("sgrt-ceiling").unwrap() else {
            panic!("no station");
        };
        // Gantry angle; for the left, right and foot pod (the station's order) whether it is
        // hidden.
        for (gantry_deg, hidden) in [
            (0.0, [false, false, false]),
            (40.0, [false, true, false]),
            (320.0, [true, false, false]),
            (90.0, [false, false, false]),
            (180.0, [false, false, false]),
            (270.0, [false, false, false]),
        ] {
            for (device, hidden) in station.device.iter().zip(hidden) {
                let place = device.rig().unwrap();
                let camera = DVec3::from_array(place.position_mm);
                assert_eq!(
                    hides(gantry_deg, camera),
                    hidden,
                    "{} at {gantry_deg} degrees",
                    device.name
                );
                // If the camera of a pod is hidden, so is the projector next to it.
                let profile = Profile::load(&station.profile(device)).unwrap();
                let room_from_rig =
                    Pose::from_xyz_deg(camera, DVec3::from_array(place.rotation_deg));
                let projector = DVec3::from_array(profile.projector.position_mm);
                if hidden {
                    assert!(hides(gantry_deg, room_from_rig.point(projector)));
                }
            }
        }
    }
}
