//! Light that surfaces throw on each other.

use phasmid_core::check::Check;
use phasmid_core::error::Result;
use serde::{Deserialize, Serialize};

/// One diffuse bounce of the light of projector and lamps, from every surface on every other that
/// it can see. What bounces twice is left out: of the light that reaches a surface in a concavity
/// no more than (albedo F)^2 / (1 - albedo F), F the largest share of a point's sky that other
/// surfaces fill. Constant ambient light does not bounce: it falls on every surface alike, so its
/// bounces are in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Interreflection {
    /// Rays that gather the light of a point: a multiple of 16 from 16 to 1024. The bounced light
    /// is off by some 0.3 / samples^0.75 of what would bounce if all of the sky were lit surface.
    pub samples: u32,
    /// Light is gathered at every so many columns and rows of the camera, and in between where no
    /// such place is on the same smooth surface.
    #[serde(default = "step_px")]
    pub step_px: u32,
}

fn step_px() -> u32 {
    4
}

pub(super) fn check(interreflection: Interreflection, check: &Check<'_>) -> Result<()> {
    let Interreflection { samples, step_px } = interreflection;
    check.that(
        (16..=1024).contains(&samples) && samples.is_multiple_of(16),
        "interreflection.samples",
        samples,
        "a multiple of 16 from 16 to 1024",
    )?;
    check.within("interreflection.step_px", step_px, 1..=64)
}
