//! A shot: one exposure that the firmware asks of the optics.

use super::Slide;
use std::sync::Arc;

/// What the camera exposes to, and when, in device time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Shot {
    /// The frame's identity, never repeated in a device's life.
    pub id: u64,
    /// Keys the noise. Triggered and free-running exposures are counted apart, so that a sequence
    /// looks the same however long the camera ran free before it.
    pub noise_id: u64,
    /// Position of the slide in the selected sequence; `None` when running free.
    pub pattern_index: Option<u32>,
    /// What the projector shows; `None` with its light off.
    pub slide: Option<Arc<Slide>>,
    /// Projector light relative to full current, 0 to 1.
    pub light: f64,
    /// Start of the exposure in nanoseconds of device time.
    pub start_ns: u64,
    /// Length of the exposure in nanoseconds.
    pub exposure_ns: u64,
    /// Gain in decibels above the sensor's base gain.
    pub gain_db: f64,
}
