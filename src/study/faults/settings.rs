//! The settings of the matrix: small devices, so that a thousand scans take a minute.

use super::Setting;
use crate::desk::Link;
use phasmid_core::error::Result;
use phasmid_profile::{Profile, Scene};

/// Columns of the camera: the minimum for an embedded data line.
const WIDTH_PX: u32 = 256;
/// Rows of the camera.
const HEIGHT_PX: u32 = 96;

/// Returns a built-in profile with only the middle of its sensor, with or without a data line.
fn small(name: &str, data_line: bool) -> Result<Profile> {
    let mut profile = Profile::load(name)?;
    let camera = &mut profile.camera;
    camera.sensor_width_mm *= f64::from(WIDTH_PX) / f64::from(camera.width_px);
    (camera.width_px, camera.height_px) = (WIDTH_PX, HEIGHT_PX);
    camera.data_line = data_line;
    Ok(profile)
}

fn setting(name: &str, profile: Profile, scene: &str, link: Link) -> Result<Setting> {
    Ok(Setting {
        name: name.to_owned(),
        profile,
        scene: Scene::load(scene)?,
        link,
        dialect: None,
    })
}

/// Ways to identify frames: name, whether there is a data line, and link.
const LINKS: [(&str, bool, Link); 3] = [
    ("identified", false, Link::Identified),
    ("data line", true, Link::Anonymous),
    ("counted only", false, Link::Anonymous),
];
/// Bench devices and scenes. In the default table each link has one device and one scene, so that each
/// link occurs; with `each` it has all combinations.
const DEVICES: [&str; 4] = ["webcam-grey", "dlp-evm", "pmp-bench", "pmp-real"];
const SCENES: [&str; 3] = ["sphere", "torso", "plane"];
/// A device whose only fringes are sets of three steps, and its scenes; a plane is too bright for it.
const POD: &str = "sgrt-pod";
const POD_SCENES: [&str; 2] = ["sphere", "torso"];
/// Distance in millimetres by which a pod's scene is moved back compared with a bench's.
const FARTHER_MM: f64 = 1400.0;
/// Factor on the albedo of a pod's scene, which makes it about as dark as skin.
const DARKER: f64 = 0.6;

/// Returns the settings for faults of frames: each way to identify frames with one device and one
/// scene, and the pod with full identification and without identification. If `each` is set,
/// all combinations of devices, scenes and ways to identify frames are returned.
///
/// # Errors
/// Returns no error, as long as the built-in profiles are valid.
pub fn frames(each: bool) -> Result<Vec<Setting>> {
    let mut all = Vec::new();
    for (l, (name, line, link)) in LINKS.into_iter().enumerate() {
        for (d, device) in DEVICES.into_iter().enumerate() {
            for (s, scene) in SCENES.into_iter().enumerate() {
                if each || (s == l && d == l % 2) {
                    let name = format!("{name}, {device}, {scene}");
                    all.push(setting(&name, small(device, line)?, scene, link)?);
                }
            }
        }
        for (s, scene) in POD_SCENES.into_iter().enumerate() {
            // By default, scan the pod with full identification and without identification.
            if each || 2 * s == l {
                let name = format!("{name}, {POD}, {scene}");
                let mut far = setting(&name, small(POD, line)?, scene, link)?;
                for object in &mut far.scene.object {
                    object.position_mm[2] += FARTHER_MM;
                    object.albedo *= DARKER;
                }
                all.push(far);
            }
        }
    }
    Ok(all)
}

/// Returns the settings for faults of messages: one per dialect.
///
/// # Errors
/// Returns no error, as long as the built-in profiles are valid.
pub fn messages() -> Result<Vec<Setting>> {
    [
        ("SCPI", None),
        ("okline", Some("okline")),
        ("dlpc350", Some("dlpc350")),
    ]
    .into_iter()
    .map(|(name, dialect)| {
        let profile = small("webcam-grey", false)?;
        Ok(Setting {
            dialect,
            ..setting(name, profile, "sphere", Link::Identified)?
        })
    })
    .collect()
}
