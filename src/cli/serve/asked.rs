//! Resolves the profiles, stations and scenes of the command line into devices.

use super::args::Args;
use super::video;
use crate::cli::dialect;
use phasmid_core::error::{Error, Result};
use phasmid_profile::{Configuration, MAX_DEVICES, Profile, RigPlace, Scene, Settings};
use std::collections::HashMap;

/// Default scene.
const SCENE: &str = "torso";

/// A requested device.
pub(super) struct Asked {
    /// Name of the device in the server: its name in the station, or its profile's name. A number
    /// is appended to a repeated name.
    pub(super) name: String,
    /// Name or path of the device's profile, as given.
    pub(super) label: String,
    /// The device's profile.
    pub(super) profile: Profile,
    /// Index of the device's scene in the list of scenes.
    pub(super) scene: usize,
    /// Pose of the device's rig in the scene; `None` for the pose that the scene states.
    pub(super) rig: Option<RigPlace>,
    /// Seed of the device's noise.
    pub(super) seed: u64,
}

/// A scene, and its name or path as given.
pub(super) type Chosen = (String, Scene);

/// A requested device whose index among all devices is not known yet.
struct Draft {
    name: String,
    label: String,
    profile: Profile,
    scene: Option<String>,
    rig: Option<RigPlace>,
    seed: Option<u64>,
}

/// Returns the devices and their scenes. Devices with the same scene share it.
///
/// # Errors
/// Returns an error if a profile, station or scene cannot be read, or options contradict each other.
pub(super) fn asked(args: &Args) -> Result<(Vec<Asked>, Vec<Chosen>)> {
    let settings = args.set.settings()?;
    let mut drafts = Vec::new();
    for label in &args.profile {
        take(label, &settings, &mut drafts)?;
    }
    check(args, drafts.len())?;
    // Scenes of the command line: one for all devices, or one for each, even if they are equal.
    let mut names = args.scene.clone();
    let mut devices: Vec<Asked> = Vec::new();
    let mut seen: HashMap<String, u64> = HashMap::new();
    for (at, draft) in drafts.into_iter().enumerate() {
        let scene = match args.scene.len() {
            0 => {
                let wanted = draft.scene.as_deref().unwrap_or(SCENE);
                let known = names.iter().position(|name| name == wanted);
                known.unwrap_or_else(|| {
                    names.push(wanted.to_owned());
                    names.len() - 1
                })
            }
            count => at % count,
        };
        let times = seen.entry(draft.name.clone()).or_default();
        *times += 1;
        devices.push(Asked {
            name: match *times {
                1 => draft.name,
                again => format!("{}-{again}", draft.name),
            },
            label: draft.label,
            profile: draft.profile,
            scene,
            rig: draft.rig,
            seed: args.seed.wrapping_add(draft.seed.unwrap_or(at as u64)),
        });
    }
    let load = |name: String| Scene::load_with(&name, &settings).map(|scene| (name, scene));
    let scenes = names.into_iter().map(load).collect::<Result<_>>()?;
    Ok((devices, scenes))
}

/// Adds the device of a profile, or the devices of a station.
fn take(label: &str, settings: &Settings, drafts: &mut Vec<Draft>) -> Result<()> {
    match Configuration::load_with(label, settings)? {
        Configuration::Device(profile) => drafts.push(Draft {
            name: profile.name.clone(),
            label: label.to_owned(),
            profile: *profile,
            scene: None,
            rig: None,
            seed: None,
        }),
        Configuration::Station(station) => {
            for device in &station.device {
                let label = station.profile(device);
                let profile = dialect::profile_of(&station, device, settings)?;
                drafts.push(Draft {
                    name: device.name.clone(),
                    profile,
                    label,
                    scene: station.scene(),
                    rig: device.rig(),
                    seed: device.seed,
                });
            }
        }
    }
    Ok(())
}

/// Rejects options that contradict the number of devices.
fn check(args: &Args, devices: usize) -> Result<()> {
    let scenes = args.scene.len();
    if devices > MAX_DEVICES {
        let allowed = format!("up to {MAX_DEVICES} devices");
        let found = format!("{devices} devices");
        return Err(Error::input("--profile", found, allowed));
    }
    if scenes > 1 && scenes != devices {
        return Err(Error::input(
            "--scene",
            format!("{scenes} scenes for {devices} devices"),
            "one for all, or one for each device",
        ));
    }
    if let Some(port) = args.tcp.filter(|&port| port != 0 && devices > 1) {
        return Err(Error::input(
            format!("--tcp {port}"),
            format!("one port for {devices} devices"),
            "--tcp 0, a free port for each",
        ));
    }
    video::check(args, devices)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        args: Args,
    }

    fn devices(line: &[&str]) -> Result<(Vec<Asked>, Vec<Chosen>)> {
        let line = Line::parse_from([&["serve"], line].concat());
        asked(&line.args)
    }

    #[test]
    fn repeated_names_get_a_number() {
        let profiles = ["pmp-bench", "webcam-grey", "pmp-bench", "pmp-bench"];
        let line = profiles.map(|profile| ["--profile", profile]).concat();
        let (devices, scenes) = devices(&line).unwrap();
        let names: Vec<_> = devices.iter().map(|device| device.name.as_str()).collect();
        let want = ["pmp-bench", "webcam-grey", "pmp-bench-2", "pmp-bench-3"];
        assert_eq!(names, want);
        assert!(devices.iter().all(|device| device.scene == 0));
        assert_eq!((scenes.len(), scenes[0].0.as_str()), (1, SCENE));
    }

    #[test]
    fn a_station_brings_its_devices_and_its_scene() {
        let line = [
            "--profile",
            "two-pods",
            "--profile",
            "webcam-grey",
            "--seed",
            "10",
        ];
        let (found, scenes) = devices(&line).unwrap();
        let names: Vec<_> = found.iter().map(|device| device.name.as_str()).collect();
        assert_eq!(names, ["left", "right", "webcam-grey"]);
        let seeds: Vec<_> = found.iter().map(|device| device.seed).collect();
        assert_eq!(seeds, [11, 12, 12]);
        assert!(found[0].rig.is_some() && found[2].rig.is_none());
        assert_eq!((scenes.len(), scenes[0].0.as_str()), (1, "torso"));
        let (found, scenes) = devices(&[&line[..], &["--scene", "plane"]].concat()).unwrap();
        assert!(found.iter().all(|device| device.scene == 0) && scenes[0].0 == "plane");
        // If `--scene` is given once per device, each device has its own scene, even if the scenes
        // are equal.
        let each = ["--scene", "plane"].repeat(3);
        let (found, scenes) = devices(&[&line[..], &each].concat()).unwrap();
        assert_eq!((found[2].scene, scenes.len()), (2, 3));
        assert!(devices(&[&line[..], &each[2..]].concat()).is_err());
    }
}
