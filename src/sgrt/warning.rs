//! What a reader of a tracked pose has to know before trusting it.

use super::rigid::{Freedom, shape};
use std::fmt;

/// A reason to doubt an answer. With any of them the beam is held.
#[derive(Debug, Clone, PartialEq)]
pub enum Warning {
    /// The shape does not determine these motions: along them the answer is where the search started.
    Undetermined {
        /// The motions.
        free: Vec<Freedom>,
        /// Smallest of their expected deviations in millimetres; infinite where nothing is known.
        deviation_mm: f64,
        /// Above which a motion counts as not determined.
        tolerance_mm: f64,
    },
    /// The iterations ended before they came to rest.
    NotConverged {
        /// RMS displacement of the last step in millimetres.
        step_mm: f64,
    },
    /// Points differ from the surface by more than their noise allows.
    Misfit {
        /// Their spread over the one that their deviations promise.
        factor: f64,
    },
    /// Little of the region of interest has been measured.
    Coverage {
        /// Share of its area.
        share: f64,
    },
    /// Another pose fits nearly as well.
    Ambiguous {
        /// How far it moves the region's points from this one, RMS, in millimetres.
        apart_mm: f64,
    },
    /// The surface is further from what planning has seen than the model allows for.
    OutsideModel {
        /// Length of the motion's coefficients in deviations of planning.
        deviations: f64,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Undetermined {
                free,
                deviation_mm,
                tolerance_mm,
            } => {
                let names: Vec<String> = free.iter().map(ToString::to_string).collect();
                write!(f, "not determined by the surface: {}", names.join(", "))?;
                if let Some(shape) = shape(free) {
                    write!(f, " (it is shaped like {shape})")?;
                }
                if deviation_mm.is_finite() {
                    write!(f, "; expected deviation {deviation_mm:.2} mm")?;
                } else {
                    write!(f, "; nothing is known of them")?;
                }
                write!(f, ", allowed: {tolerance_mm} mm")
            }
            Self::NotConverged { step_mm } => {
                write!(f, "not converged: the last step moved {step_mm:.3} mm")
            }
            Self::Misfit { factor } => write!(
                f,
                "the surface does not fit: residuals are {factor:.1} times their noise"
            ),
            Self::Coverage { share } => write!(
                f,
                "only {:.0} % of the region of interest is measured",
                100.0 * share
            ),
            Self::Ambiguous { apart_mm } => write!(
                f,
                "another pose, {apart_mm:.1} mm away, fits nearly as well"
            ),
            Self::OutsideModel { deviations } => write!(
                f,
                "the motion is {deviations:.1} deviations away from what planning has seen"
            ),
        }
    }
}

/// Why there is no answer.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Lost {
    /// Too few points lie over the region.
    #[error("lost: {found} measured points over the region of interest, want {wanted} or more")]
    Points {
        /// How many do.
        found: usize,
        /// How many it takes.
        wanted: usize,
    },
    /// The points lie on a line, or are one.
    #[error("lost: the measured points over the region of interest lie on a line")]
    Line,
}
