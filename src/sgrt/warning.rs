//! Warnings and errors of the trackers.

use super::rigid::{Freedom, shape};
use phasmid_decode::FrameDoubt;
use std::fmt;

/// A reason to doubt a result. Any warning holds the beam.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// The shape does not determine these motions: along them the result keeps the start values.
    Undetermined {
        /// The undetermined motions.
        free: Vec<Freedom>,
        /// Smallest expected standard deviation of these motions in millimetres; infinite if there is no
        /// information.
        deviation_mm: f64,
        /// Standard deviation above which a motion counts as undetermined, in millimetres.
        tolerance_mm: f64,
    },
    /// The iterations ended without convergence.
    NotConverged {
        /// Size of the last step: RMS displacement in millimetres, or, in the motion fit, the largest
        /// unknown (standard deviations, mm or rad).
        step_mm: f64,
    },
    /// Points differ from the surface by more than their noise allows.
    Misfit {
        /// Scale of the residuals in units of their standard deviations.
        factor: f64,
    },
    /// Too little of the region of interest has been measured.
    Coverage {
        /// Fraction of the region's area that is measured.
        share: f64,
    },
    /// Another pose fits nearly as well.
    Ambiguous {
        /// RMS distance between the region's points under the two poses, in millimetres.
        apart_mm: f64,
    },
    /// The surface differs from the surfaces of planning by more than the model allows.
    OutsideModel {
        /// Largest absolute coefficient of the motion, in standard deviations of planning.
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
                    write!(f, "; expected standard deviation {deviation_mm:.2} mm")?;
                } else {
                    write!(f, "; the surface gives no information on them")?;
                }
                write!(f, ", allowed: {tolerance_mm} mm")
            }
            Self::NotConverged { step_mm } => {
                write!(
                    f,
                    "not converged: size of the last step {step_mm:.3} (RMS in mm; in a motion fit, \
                     the largest unknown in standard deviations, mm or rad)"
                )
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
                "the motion is {deviations:.1} standard deviations from what planning has seen"
            ),
        }
    }
}

/// The reason why tracking has failed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Lost {
    /// Too few points lie over the region.
    #[error("lost: {found} measured points over the region of interest, expected {wanted} or more")]
    Points {
        /// Number of points over the region.
        found: usize,
        /// Minimum number.
        wanted: usize,
    },
    /// The points lie on a line or coincide.
    #[error("lost: the measured points over the region of interest lie on a line")]
    Line,
}

/// Reason to doubt the results of a scan. It displays as a message for users.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ScanWarning {
    /// The frames of a pod do not follow their sequence and added no points.
    #[error("{pod}: {why}")]
    Rejected {
        /// Name of the pod.
        pod: String,
        /// How the frames differ from the sequence.
        why: FrameDoubt,
    },
    /// The fit on which the beam depends is unreliable.
    #[error("{0}")]
    Fit(Warning),
    /// The fit on which the beam depends has failed.
    #[error(transparent)]
    Lost(#[from] Lost),
    /// The rigid pose is unreliable, where the beam depends on another fit.
    #[error("rigid: {0}")]
    Rigid(Warning),
    /// The rigid fit has failed, where the beam depends on another fit.
    #[error("rigid: {0}")]
    RigidLost(Lost),
}
