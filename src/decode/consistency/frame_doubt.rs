//! The result of the checks: why frames are doubted.

use phasmid_pattern::Axis;
use std::fmt;
use std::ops::RangeInclusive;

/// Why frames are rejected, or why their points may be biased. It displays as a message for users.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum FrameDoubt {
    /// The frames differ in size; the text lists the sizes.
    Sizes(String),
    /// Many pixels reach the camera's full scale, and hardly any other pixel varies.
    Saturated {
        /// Fraction of the pixels that reach full scale, 0 to 1.
        share: f64,
    },
    /// Two frames have exchanged places.
    Exchanged {
        /// Positions of the two frames in the sequence.
        frames: [usize; 2],
    },
    /// One step of a fringe set had more or less light than the other steps, or showed another pattern.
    Light {
        /// Position of the step's frame in the sequence.
        frame: usize,
        /// Light of the step relative to the light of the other steps.
        part: f64,
    },
    /// The fringes had distinctly less light than the white frame.
    Dark {
        /// First and last frame of the fringe set.
        frames: RangeInclusive<usize>,
        /// Light of the fringes relative to white.
        part: f64,
    },
    /// Frames contradict each other in more pixels, or by more, than noise explains.
    Contradictory {
        /// Projector axis whose frames contradict each other.
        axis: Axis,
        /// Fraction of the pixels that contradict themselves, 0 to 1.
        share: f64,
        /// First and last frame of the set, if only one set contradicts itself.
        frames: Option<RangeInclusive<usize>>,
        /// First and last row with contradictory pixels, if these are confined to a part of the image.
        rows: Option<RangeInclusive<usize>>,
    },
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
        const DEPARTS: &str = "the frames do not follow the sequence";
        match self {
            Self::Sizes(what) => f.write_str(what),
            Self::Saturated { share } => write!(
                f,
                "the frames are saturated: {:.0} % of the pixels reach the camera's full scale, and \
                 hardly any others vary; shorten the exposure or dim the projector",
                100.0 * share
            ),
            Self::Exchanged {
                frames: [one, other],
            } => write!(f, "{DEPARTS}: frames {one} and {other} look exchanged"),
            Self::Light { frame, part } => write!(
                f,
                "{DEPARTS}: frame {frame} has {part:.2} of the light of the other steps of fringes"
            ),
            Self::Dark { frames, part } => write!(
                f,
                "{DEPARTS}: the fringes of frames {} to {} have {part:.2} of the light that white has",
                frames.start(),
                frames.end()
            ),
            Self::Contradictory {
                axis,
                share,
                frames,
                rows,
            } => {
                write!(f, "{DEPARTS}: ")?;
                match frames {
                    Some(frames) => write!(f, "frames {} to {}", frames.start(), frames.end())?,
                    None => write!(f, "the frames of axis {axis}")?,
                }
                write!(
                    f,
                    " contradict each other in {:.1} % of the pixels",
                    100.0 * share
                )?;
                if let Some(rows) = rows {
                    write!(f, ", in rows {} to {}", rows.start(), rows.end())?;
                }
                f.write_str(
                    ": a frame is damaged, or shows another pattern or another time, or something moved",
                )
            }
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
        let torn = FrameDoubt::Contradictory {
            axis: Axis::X,
            share: 0.1234,
            frames: None,
            rows: Some(300..=479),
        };
        assert_eq!(
            torn.to_string(),
            "the frames do not follow the sequence: the frames of axis x contradict each other in \
             12.3 % of the pixels, in rows 300 to 479: a frame is damaged, or shows another pattern or \
             another time, or something moved"
        );
    }
}
