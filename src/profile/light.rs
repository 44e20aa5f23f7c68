//! Light sources in a scene other than the projector.

use phasmid_core::check::Check;
use phasmid_core::error::Result;
use serde::{Deserialize, Serialize};

/// Maximum number of lamps in a scene, because shadow edges are detected with one bit per lamp.
const MAX_LIGHTS: usize = 32;

/// Constant light that is equal on all surfaces.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Ambient {
    /// Irradiance in W/m^2 at the projector's wavelength.
    pub irradiance_w_m2: f64,
    /// Mains flicker; steady when absent.
    #[serde(default)]
    pub flicker: Option<Flicker>,
}

/// A lamp that casts shadows. Its light is added to the ambient light and does not depend on the
/// projected pattern.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Light {
    /// An isotropic point source, itself invisible to the camera.
    Point {
        /// Position in the scene's frame in millimetres.
        #[serde(deserialize_with = "phasmid_core::numbers::exactly")]
        position_mm: [f64; 3],
        /// Radiant intensity in W/sr at the projector's wavelength.
        intensity_w_sr: f64,
        /// Mains flicker; steady when absent.
        #[serde(default)]
        flicker: Option<Flicker>,
    },
    /// Light from one direction, such as sunlight.
    Directional {
        /// Direction of travel in the scene's frame, of any length.
        #[serde(deserialize_with = "phasmid_core::numbers::exactly")]
        direction: [f64; 3],
        /// Irradiance in W/m^2 of a surface perpendicular to it, at the projector's wavelength.
        irradiance_w_m2: f64,
        /// Mains flicker; steady when absent.
        #[serde(default)]
        flicker: Option<Flicker>,
    },
}

/// Mains flicker: light is its mean times 1 + depth cos(2 pi f t + phase), where t is device time.
/// This is the modulation of IEEE Std 1789-2015 (`depth` is its modulation percentage over 100).
/// All flickering light in a scene shares one mains supply, hence frequency and phase.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Flicker {
    /// Twice the mains frequency: 100 or 120 Hz.
    pub frequency_hz: u32,
    /// Amplitude relative to the mean, 0 to 1.
    pub depth: f64,
    /// Phase at device time 0 in degrees.
    #[serde(default)]
    pub phase_deg: f64,
}

impl Ambient {
    /// Returns the flicker; `None` if the light is off or steady.
    #[inline]
    pub fn pulse(&self) -> Option<Flicker> {
        let pulsates = |f: &Flicker| f.depth > 0.0 && self.irradiance_w_m2 > 0.0;
        self.flicker.filter(pulsates)
    }
}

impl Light {
    /// Returns whether the lamp emits any light.
    #[inline]
    pub fn is_on(&self) -> bool {
        match *self {
            Self::Point { intensity_w_sr, .. } => intensity_w_sr > 0.0,
            Self::Directional {
                irradiance_w_m2, ..
            } => irradiance_w_m2 > 0.0,
        }
    }

    /// Returns the flicker; `None` if the light is off or steady.
    pub fn pulse(&self) -> Option<Flicker> {
        let pulsates = |f: &Flicker| f.depth > 0.0 && self.is_on();
        self.flicker().filter(pulsates)
    }

    /// Returns the configured flicker, even if the light is off.
    #[inline]
    pub fn flicker(&self) -> Option<Flicker> {
        match *self {
            Self::Point { flicker, .. } | Self::Directional { flicker, .. } => flicker,
        }
    }
}

pub(super) fn check(ambient: &Ambient, lights: &[Light], check: &Check<'_>) -> Result<()> {
    let power = 0.0..=1e6;
    check.within(
        "ambient.irradiance_w_m2",
        ambient.irradiance_w_m2,
        power.clone(),
    )?;
    check.that(
        lights.len() <= MAX_LIGHTS,
        "light",
        format!("{} lights", lights.len()),
        format!("up to {MAX_LIGHTS} lights"),
    )?;
    let mut mains = None;
    flicker(ambient.flicker, "ambient", &mut mains, check)?;
    for (i, light) in lights.iter().enumerate() {
        let at = format!("light[{i}]");
        match light {
            Light::Point {
                position_mm,
                intensity_w_sr,
                ..
            } => {
                let field = format!("{at}.position_mm");
                check.all_within(&field, position_mm, -1e9..=1e9)?;
                let field = format!("{at}.intensity_w_sr");
                check.within(&field, *intensity_w_sr, power.clone())?;
            }
            Light::Directional {
                direction,
                irradiance_w_m2,
                ..
            } => {
                let field = format!("{at}.direction");
                check.all_within(&field, direction, -1e9..=1e9)?;
                check.that(
                    direction.iter().any(|d| d.abs() >= 1e-9),
                    &field,
                    "no direction",
                    "three numbers, one of them at least 1e-9",
                )?;
                let field = format!("{at}.irradiance_w_m2");
                check.within(&field, *irradiance_w_m2, power.clone())?;
            }
        }
        flicker(light.flicker(), &at, &mut mains, check)?;
    }
    Ok(())
}

fn flicker(
    flicker: Option<Flicker>,
    at: &str,
    mains: &mut Option<Flicker>,
    check: &Check<'_>,
) -> Result<()> {
    let Some(flicker) = flicker else {
        return Ok(());
    };
    let field = |name: &str| format!("{at}.flicker.{name}");
    check.that(
        matches!(flicker.frequency_hz, 100 | 120),
        &field("frequency_hz"),
        flicker.frequency_hz,
        "100 or 120",
    )?;
    check.within(&field("depth"), flicker.depth, 0.0..=1.0)?;
    check.within(&field("phase_deg"), flicker.phase_deg, -360.0..=360.0)?;
    let first = mains.get_or_insert(flicker);
    check.that(
        (first.frequency_hz, first.phase_deg) == (flicker.frequency_hz, flicker.phase_deg),
        &format!("{at}.flicker"),
        format!(
            "{} Hz at {} degrees",
            flicker.frequency_hz, flicker.phase_deg
        ),
        format!(
            "{} Hz at {} degrees, like the previous lights",
            first.frequency_hz, first.phase_deg
        ),
    )
}
