//! Levenberg-Marquardt minimisation (Marquardt, "An algorithm for least-squares estimation of
//! nonlinear parameters", SIAM J. 11, 1963). Damping scales the diagonal: it rises after a failed
//! step and drops quickly to zero after successful ones, because damping slows convergence along
//! weakly determined directions.

use super::model::State;
use super::normal::{Free, Normal};
use super::observation::PoseObservations;
use super::refusal::Why;
use super::robust::Loss;
use phasmid_core::Stop;

/// Result of a minimisation.
pub(super) struct Fit {
    pub state: State,
    /// Whether the last step was too small to matter.
    pub converged: bool,
    /// Squared length, in standard deviations, of the next undamped step; `None` if the free
    /// unknowns are not determined.
    pub next: Option<f64>,
}

/// Termination criteria.
#[derive(Clone, Copy)]
pub(super) struct Effort {
    /// Maximum number of steps, including rejected ones.
    pub most: usize,
    /// Iteration ends after a step that reduces the loss by less than this fraction.
    pub gain: f64,
}

impl Effort {
    /// Ends as soon as the state is close enough to the minimum for the next stage.
    pub const ROUGH: Self = Self {
        most: 25,
        gain: 1e-3,
    };
    /// Iterates down to rounding errors.
    pub const FULL: Self = Self {
        most: 60,
        gain: 0.0,
    };
}

/// Iteration ends after a step whose squared length (in standard deviations) is below this.
/// Convergence is quadratic, so the next step would be negligible.
const SHORT: f64 = 1e-8;
/// Damping below this is set to zero.
const UNDAMPED: f64 = 1e-8;
/// Below this squared step length (in standard deviations), the change of the loss may be lost in
/// rounding.
const NEAR: f64 = 1e-3;
/// Iteration ends if damping exceeds this.
const MOST_DAMPING: f64 = 1e8;

/// Minimises the loss from a starting state.
///
/// # Errors
/// Returns [`Why::NoStart`] if the loss is undefined at the starting state, and [`Why::Stopped`] if
/// a stop is requested.
pub(super) fn minimise(
    poses: &[PoseObservations],
    start: &State,
    free: &Free,
    loss: &Loss,
    effort: Effort,
    stop: &Stop,
) -> Result<Fit, Why> {
    let mut state = start.clone();
    let mut normal = Normal::at(poses, &state, loss).ok_or(Why::NoStart)?;
    let mut damping = 1e-4;
    let (mut converged, mut next) = (false, None);
    for _ in 0..effort.most {
        stop.check().map_err(|_| Why::Stopped)?;
        let undamped = normal.step(free, 0.0);
        next = undamped.as_ref().map(|s| s.length);
        let length = next.unwrap_or(f64::INFINITY);
        if let Some(step) = undamped.filter(|_| length <= SHORT * (1.0 + 1e-3 * normal.loss)) {
            state = state.stepped(&step.rig, &step.boards);
            converged = state.is_proper();
            break;
        }
        // This close to the minimum, rounding of the loss exceeds the gain of a step, so accept a
        // small rise.
        let slack = if length < NEAR { NEAR } else { 0.0 };
        // A damped step exists even if the undamped system is singular.
        let there = normal.step(free, damping).and_then(|step| {
            let next = state.stepped(&step.rig, &step.boards);
            let there = next.is_proper().then(|| Normal::at(poses, &next, loss))??;
            (there.loss <= normal.loss + slack).then_some((next, there))
        });
        let Some((nearer, there)) = there else {
            damping = (damping * 10.0).max(UNDAMPED);
            if damping > MOST_DAMPING {
                break;
            }
            continue;
        };
        let little = effort.gain > 0.0 && normal.loss - there.loss < effort.gain * there.loss;
        (state, normal) = (nearer, there);
        if little {
            break;
        }
        damping *= 0.01;
        if damping < UNDAMPED {
            damping = 0.0;
        }
    }
    Ok(Fit {
        state,
        converged,
        next,
    })
}
