//! Settings of the decoding: which pixels it keeps, and which corrections it applies.

use super::held::Held;
use phasmid_geometry::NoiseModel;

/// Settings of a [`Decoder`](super::Decoder).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Keeps mixed pixels, which see two surfaces at once.
    pub keep_mixed: bool,
    /// Unwraps a single wrapped period spatially.
    pub unwrap_spatial: bool,
    /// Minimum modulation B in DN.
    pub min_modulation_dn: f32,
    /// Minimum modulation B relative to half of white minus black or, if that is larger (clipped white),
    /// to the fringes' mean minus black. Applies if the sequence has white and black. A pixel that spans
    /// w > 1 periods sees the fringe inverted, half a period off, with at most max |sin(pi w) / (pi w)|
    /// = 0.217 of its contrast; the default is this contrast plus a margin for noise.
    pub min_contrast: f32,
    /// Maximum standard deviation of a set's phase in radians; less precise phases are rejected.
    pub max_phase_sigma_rad: f32,
    /// Weights the steps by their shot noise. Reduces the noise of phases of six or more equal steps,
    /// by a tenth at full contrast with 8 bits; requires the camera's gain. Makes phases slightly
    /// more sensitive to motion and to light that varies from step to step.
    pub weighted: bool,
    /// Treatment of the error due to held projector pixels.
    pub held: Held,
    /// Rejects pixels whose steps contradict each other by more than is usual in the capture, because
    /// one of their frames is damaged there. Requires four or more steps, or several sets along an
    /// axis. Decoding is a few percent faster without it.
    pub consistency: bool,
    /// The camera's noise. Takes precedence over the rig's, which takes precedence over an estimate
    /// from the frames.
    pub noise: Option<NoiseModel>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            keep_mixed: false,
            unwrap_spatial: false,
            min_modulation_dn: 2.0,
            min_contrast: 0.25,
            max_phase_sigma_rad: 0.15,
            weighted: false,
            held: Held::default(),
            consistency: true,
            noise: None,
        }
    }
}
