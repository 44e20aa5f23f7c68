//! The settings of the matrix: small devices, so that a thousand scans take a minute.

use super::{Link, Setting};
use crate::error::Result;
use crate::profile::{Profile, Scene};

/// Columns of the camera: as few as an embedded data line needs.
const WIDTH_PX: u32 = 256;
/// Rows of the camera.
const HEIGHT_PX: u32 = 96;

/// The middle of a built-in profile's sensor, with or without a data line.
fn small(name: &str, data_line: bool) -> Result<Profile> {
    let mut profile = Profile::load(name)?;
    let camera = &mut profile.camera;
    camera.sensor_width_mm *= f64::from(WIDTH_PX) / f64::from(camera.width_px);
    (camera.width_px, camera.height_px) = (WIDTH_PX, HEIGHT_PX);
    camera.data_line = data_line;
    Ok(profile)
}

fn setting(name: &str, profile: Profile, link: Link) -> Result<Setting> {
    Ok(Setting {
        name: name.to_owned(),
        profile,
        scene: Scene::load("sphere")?,
        link,
        dialect: None,
    })
}

/// Settings for faults of frames: how frames tell which they are.
///
/// # Errors
/// None, as long as the built-in profiles are sound.
pub fn frames() -> Result<Vec<Setting>> {
    let profile = |line| small("webcam-grey", line);
    Ok(vec![
        setting("identified", profile(false)?, Link::Identified)?,
        setting("data line", profile(true)?, Link::Anonymous)?,
        setting("counted only", profile(false)?, Link::Anonymous)?,
    ])
}

/// Settings for faults of messages: what is spoken.
///
/// # Errors
/// None, as long as the built-in profiles are sound.
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
            ..setting(name, profile, Link::Identified)?
        })
    })
    .collect()
}
