//! The paper's bench with single modifications.

use phasmid_core::error::Result;
use phasmid_pattern::{Axis, ManifestFrame, Pattern};
use phasmid_profile::Profile;
use phasmid_protocol::PixelFormat;
use std::f64::consts::TAU;

/// Digital numbers of the 16-bit converter per digital number of the bench's 8-bit converter: 65535
/// / 255.
pub const FINE: f64 = 257.0;

/// Period of the bench's fringes in pattern-image pixels.
pub const PERIOD_PX: f64 = 16.0;

/// Returns the bench with the middle of its sensor, of this size; up to 400 x 240 pixels all lie in the
/// projector's field.
///
/// # Errors
/// Returns no error, as long as the built-in profile is valid.
pub fn bench(width_px: u32, height_px: u32) -> Result<Profile> {
    let mut profile = Profile::load("pmp-bench")?;
    let camera = &mut profile.camera;
    camera.sensor_width_mm *= f64::from(width_px) / f64::from(camera.width_px);
    (camera.width_px, camera.height_px) = (width_px, height_px);
    camera.data_line = false;
    profile.sequence.truncate(1);
    Ok(profile)
}

/// Returns the profile with this number of steps of the fringe instead of twelve.
pub fn with_steps(mut profile: Profile, steps: usize) -> Profile {
    for sequence in &mut profile.sequence {
        let fringe = |k: usize| ManifestFrame {
            file: None,
            pattern: Pattern::Fringe {
                axis: Axis::X,
                period_px: PERIOD_PX,
                phase_rad: TAU * k as f64 / steps as f64,
            },
        };
        let others = sequence.frame.drain(..);
        let others = others.filter(|f| !matches!(f.pattern, Pattern::Fringe { .. }));
        let others: Vec<_> = others.collect();
        sequence.frame = (0..steps).map(fringe).chain(others).collect();
    }
    profile
}

/// Returns the profile with `scale` times as many pixels per side of the same field. The exposure is
/// adapted so that a pixel receives the same light.
pub fn scaled(mut profile: Profile, scale: f64) -> Profile {
    let camera = &mut profile.camera;
    let side = |px: u32| (f64::from(px) * scale).round() as u32;
    (camera.width_px, camera.height_px) = (side(camera.width_px), side(camera.height_px));
    let by = scale * scale;
    camera.exposure_us *= by;
    camera.frame_interval_us = camera.frame_interval_us.max(2.0 * camera.exposure_us);
    for sequence in &mut profile.sequence {
        sequence.period_us = sequence.period_us.max(1.25 * camera.exposure_us);
    }
    profile
}

/// Returns the profile with a 16-bit converter, whose rounding is negligible, and without noise.
pub fn fine(mut profile: Profile) -> Profile {
    let camera = &mut profile.camera;
    camera.format = PixelFormat::Y16;
    let sensor = &mut camera.sensor;
    sensor.bits = 16;
    sensor.gain_dn_per_e *= FINE;
    sensor.black_level_dn *= FINE;
    sensor.noiseless = true;
    profile
}
