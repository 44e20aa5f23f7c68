//! Interreflection: indirect light between surfaces.

use phasmid_core::check::Check;
use phasmid_core::error::Result;
use serde::{Deserialize, Serialize};

/// One diffuse bounce of projector and lamp light between all mutually visible surfaces. Further
/// bounces are neglected: in a concavity they add at most (albedo F)^2 / (1 - albedo F) of the
/// light that reaches a surface, where F is the largest fraction of a point's hemisphere filled by
/// other surfaces. Constant ambient light does not bounce: it is the same on every surface and
/// includes its bounces.
///
/// Indirect light varies slowly, so it is gathered at some pixels and interpolated in between.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Interreflection {
    /// Largest error of the indirect light, in percent of a pixel's light under full white, in 99 %
    /// of the pixels that the projector lights. The number of rays and the spacing of the gather
    /// points follow from it, by a trial with the scene at power-on; if no setting meets this
    /// error, 1024 rays are used at every pixel. Ignored if `samples` is given.
    #[serde(default = "error_percent")]
    pub error_percent: f64,
    /// Rays per gather point, instead of the number that follows from `error_percent`: a multiple
    /// of 16 from 16 to 1024.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub samples: Option<u32>,
    /// Spacing of the gather points in camera columns and rows, with `samples`; 4 if absent. Pixels
    /// without a gather point on the same smooth surface get their own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step_px: Option<u32>,
}

impl Default for Interreflection {
    fn default() -> Self {
        Self {
            error_percent: error_percent(),
            samples: None,
            step_px: None,
        }
    }
}

fn error_percent() -> f64 {
    0.5
}

pub(super) fn check(interreflection: Interreflection, check: &Check<'_>) -> Result<()> {
    let Interreflection {
        error_percent,
        samples,
        step_px,
    } = interreflection;
    check.within("interreflection.error_percent", error_percent, 0.05..=10.0)?;
    if let Some(samples) = samples {
        check.that(
            (16..=1024).contains(&samples) && samples.is_multiple_of(16),
            "interreflection.samples",
            samples,
            "a multiple of 16 from 16 to 1024",
        )?;
    }
    let Some(step_px) = step_px else {
        return Ok(());
    };
    check.that(
        samples.is_some(),
        "interreflection.step_px",
        step_px,
        "samples as well, or neither: both then follow from error_percent",
    )?;
    check.within("interreflection.step_px", step_px, 1..=64)
}
