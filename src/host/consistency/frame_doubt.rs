//! The result of the checks: why frames are doubted.

use std::fmt;
use std::ops::RangeInclusive;

/// Why frames are rejected, or why their points may be biased. It displays as a message for users.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum FrameDoubt {
    /// The frames do not have one size; the text gives the sizes.
    Sizes(String),
    /// Many pixels reach the camera's full scale, and hardly any others vary.
    Saturated {
        /// Fraction of the pixels that reach full scale, 0 to 1.
        share: f64,
    },
    /// The frames do not follow their sequence. The text names the frames and what contradicts the
    /// sequence.
    Departs(String),
    /// The frames follow their sequence, but the fringes are not sinusoidal.
    NotSinusoidal {
        /// First and last frame of the fringe set.
        frames: RangeInclusive<usize>,
        /// Amplitude of the error of the phase, in radians.
        phase_error_rad: f64,
    },
}

impl fmt::Display for FrameDoubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Sizes(what) => f.write_str(what),
            Self::Saturated { share } => write!(
                f,
                "the frames are saturated: {:.0} % of the pixels reach the camera's full scale, and \
                 hardly any others vary; shorten the exposure or dim the projector",
                100.0 * share
            ),
            Self::Departs(what) => write!(f, "the frames do not follow the sequence: {what}"),
            Self::NotSinusoidal {
                frames,
                phase_error_rad,
            } => write!(
                f,
                "the fringes of frames {} to {} are not sinusoidal: the phase is off by up to about \
                 {phase_error_rad:.2} rad; does the camera's exposure cover all of the pattern's, and is \
                 the projector's response straight?",
                frames.start(),
                frames.end()
            ),
        }
    }
}

impl std::error::Error for FrameDoubt {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_name_the_frames_and_the_figures() {
        let bent = FrameDoubt::NotSinusoidal {
            frames: 3..=5,
            phase_error_rad: 0.0349,
        };
        assert_eq!(
            bent.to_string(),
            "the fringes of frames 3 to 5 are not sinusoidal: the phase is off by up to about 0.03 rad; \
             does the camera's exposure cover all of the pattern's, and is the projector's response \
             straight?"
        );
        assert_eq!(
            FrameDoubt::Saturated { share: 0.987 }.to_string(),
            "the frames are saturated: 99 % of the pixels reach the camera's full scale, and hardly any \
             others vary; shorten the exposure or dim the projector"
        );
        let departs = FrameDoubt::Departs("frame 7 is torn".to_owned());
        let said = "the frames do not follow the sequence: frame 7 is torn";
        assert_eq!(departs.to_string(), said);
    }
}
