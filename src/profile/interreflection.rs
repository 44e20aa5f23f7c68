//! Interreflection: indirect light between surfaces.

use phasmid_core::check::Check;
use phasmid_core::error::Result;
use serde::{Deserialize, Serialize};

/// One diffuse bounce of projector and lamp light between all mutually visible surfaces. Further
/// bounces are neglected: in a concavity they add at most (albedo F)^2 / (1 - albedo F) of the
/// light that reaches a surface, where F is the largest fraction of a point's hemisphere filled by
/// other surfaces. Constant ambient light does not bounce: it is the same on every surface and
/// includes its bounces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Interreflection {
    /// Rays per gather point: a multiple of 16 from 16 to 1024. The error of the indirect light is
    /// about 0.3 / samples^0.75 of the indirect light from a hemisphere filled with lit surface.
    pub samples: u32,
    /// Spacing of the gather points in camera columns and rows. Pixels without a gather point on
    /// the same smooth surface get their own.
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
