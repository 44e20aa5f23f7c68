//! The time of a projector whose picture is made of mirrors that are on or off: a DLP controller's
//! rules for how long a pattern is shown and how often, as `[projector.timing]` of a profile.
//!
//! A pattern takes its period: darkness before, the pattern's exposure, darkness after, and what is
//! left of the period dark too. The exposure is the whole period, or shorter by at least a margin in
//! which the controller loads the next pattern (TI's DLP SDK for the LightCrafter 4500 with its
//! DLPC350: 230 us; for the LightCrafter 6500 with its DLPC900: 105 us); and it is no shorter than
//! the pattern's bits take to be shown. All times are whole steps of the controller's clock.

use serde::{Deserialize, Serialize};

/// When a projector shows what. Times are in microseconds, and whole multiples of `resolution_us`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Timing {
    /// Step of all times of the controller.
    #[serde(default = "microsecond")]
    pub resolution_us: f64,
    /// Shortest exposure of a pattern of 1, 2, up to 8 bits; as many as the projector has bits count.
    pub min_exposure_us: [f64; 8],
    /// How long a pattern is shown after power-on and `*RST`; as long as the period allows when
    /// absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exposure_us: Option<f64>,
    /// Shorter than the period by at least this, unless it is the whole period.
    #[serde(default)]
    pub margin_us: f64,
    /// Darkness before each pattern, from its trigger or the end of the former period on.
    #[serde(default)]
    pub dark_before_us: f64,
    /// Darkness after each pattern.
    #[serde(default)]
    pub dark_after_us: f64,
    /// From a trigger to the start of the first pattern's period, beside `TRIGger:DELay`.
    #[serde(default)]
    pub trigger_delay_us: f64,
    /// From the start of a pattern's period to that of the camera's exposure, by the controller's
    /// trigger output; that of the pattern itself (`dark_before_us`) when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_delay_us: Option<f64>,
    /// How long a selected sequence takes from the flash memory to the controller's, for each buffer
    /// of 24 bit planes that it fills.
    #[serde(default)]
    pub load_us: f64,
    /// Grey patterns are shown bit by bit, so that an exposure which does not cover a pattern sees
    /// some of its bits only. Without it a level is light of that strength for the whole time.
    #[serde(default)]
    pub bit_planes: bool,
}

fn microsecond() -> f64 {
    1.0
}
