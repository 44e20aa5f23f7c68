//! The minimum by Levenberg's and Marquardt's method (Marquardt, "An algorithm for least-squares
//! estimation of nonlinear parameters", SIAM J. 11, 1963): the diagonal is raised where a step fails,
//! and hardly or not at all where steps succeed, as weak directions would creep otherwise.

use super::model::State;
use super::normal::{Free, Normal};
use super::observation::PoseObservations;
use super::robust::Loss;

/// A state and how it was come by.
pub(super) struct Fit {
    pub state: State,
    /// Whether the last step was too small to matter.
    pub converged: bool,
    /// Squared length in standard deviations of the step that would come next, undamped; `None`
    /// where the free unknowns are not determined.
    pub next: Option<f64>,
}

/// How far to go.
#[derive(Clone, Copy)]
pub(super) struct Effort {
    /// Steps that are tried at most.
    pub most: usize,
    /// A step that lowers the loss by less than this part of it is the last.
    pub gain: f64,
}

impl Effort {
    /// Near enough for the next stage.
    pub const ROUGH: Self = Self {
        most: 25,
        gain: 1e-3,
    };
    /// To rounding.
    pub const FULL: Self = Self {
        most: 60,
        gain: 0.0,
    };
}

/// A step this long in squared standard deviations is the last: the next one would be its square.
const SHORT: f64 = 1e-8;
/// Damping below this is none.
const UNDAMPED: f64 = 1e-8;
/// A step, in squared standard deviations, that changes nothing worth telling.
const NEAR: f64 = 1e-3;
const MOST_DAMPING: f64 = 1e8;

/// Lowers the loss from a state on; `None` where the loss has no value there.
pub(super) fn minimise(
    poses: &[PoseObservations],
    start: &State,
    free: &Free,
    loss: &Loss,
    effort: Effort,
) -> Option<Fit> {
    let mut state = start.clone();
    let mut normal = Normal::at(poses, &state, loss)?;
    let mut damping = 1e-4;
    let (mut converged, mut next) = (false, None);
    for _ in 0..effort.most {
        let undamped = normal.step(free, 0.0);
        next = undamped.as_ref().map(|s| s.length);
        let length = next.unwrap_or(f64::INFINITY);
        if let Some(step) = undamped.filter(|_| length <= SHORT * (1.0 + 1e-3 * normal.loss)) {
            state = state.stepped(&step.rig, &step.boards);
            converged = state.is_proper();
            break;
        }
        // So near the end what the loss gains is lost in its rounding.
        let slack = if length < NEAR { NEAR } else { 0.0 };
        // Where nothing determines a step, what damping finds is still nearer.
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
    Some(Fit {
        state,
        converged,
        next,
    })
}
