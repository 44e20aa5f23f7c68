//! Selection of the distortion coefficients that the data support.
//!
//! The models are nested: none, k1, k1 k2, k1 k2 p1 p2, all five; separately for camera and
//! projector. All models are judged from the fit of the largest model: removing coefficients c of
//! covariance C raises the sum of squares by c' C^-1 c (Wald's statistic), and each coefficient
//! kept costs ln n (the Bayesian information criterion; Schwarz, "Estimating the dimension of a
//! model", 1978), where n is the number of observations. The cost is at least 10.83, so that a
//! coefficient whose true value is zero is kept by chance once in a thousand cases whatever n is.

use super::model::State;
use super::normal::Free;
use nalgebra::{DMatrix, DVector};
use phasmid_geometry::parameters::{LENS, RIG};

/// Which distortion coefficients are estimated; the others stay zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Coefficients {
    /// Chooses among none, k1, k1 k2, k1 k2 p1 p2 and all five, by the Bayesian information
    /// criterion.
    #[default]
    Auto,
    /// Estimates the coefficients set to true, in the order k1, k2, p1, p2, k3.
    Fixed([bool; 5]),
}

/// Options of the solver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Choice {
    /// Coefficients of the camera to estimate.
    pub camera: Coefficients,
    /// Coefficients of the projector to estimate.
    pub projector: Coefficients,
    /// Whether to exclude outlier points and inconsistent poses. If false, all points and poses are
    /// used.
    pub robust: bool,
}

impl Default for Choice {
    fn default() -> Self {
        Self {
            camera: Coefficients::Auto,
            projector: Coefficients::Auto,
            robust: true,
        }
    }
}

/// Coefficients to estimate, of k1 k2 p1 p2 k3, for camera and projector.
pub(super) type Model = [[bool; 5]; 2];

/// The 0.1 % point of the chi-square distribution of one degree of freedom.
const LEAST_PENALTY: f64 = 10.83;

const LADDER: [[bool; 5]; 5] = [
    [false; 5],
    [true, false, false, false, false],
    [true, true, false, false, false],
    [true, true, true, true, false],
    [true; 5],
];

impl Coefficients {
    /// Largest model that the choice allows.
    pub(super) fn most(self) -> [bool; 5] {
        match self {
            Self::Auto => [true; 5],
            Self::Fixed(set) => set,
        }
    }

    /// Smallest model that the choice allows.
    pub(super) fn least(self) -> [bool; 5] {
        match self {
            Self::Auto => [false; 5],
            Self::Fixed(set) => set,
        }
    }

    fn ladder(self) -> Vec<[bool; 5]> {
        match self {
            Self::Auto => LADDER.to_vec(),
            Self::Fixed(set) => vec![set],
        }
    }
}

/// Unknowns of the rig that a model leaves free.
pub(super) fn free(model: &Model) -> Free {
    let mut free = [true; RIG];
    for (lens, set) in model.iter().enumerate() {
        let at = lens * LENS + 4;
        free[at..at + 5].copy_from_slice(set);
    }
    free
}

/// Returns the state with all coefficients outside the model set to zero.
pub(super) fn restricted(state: &State, model: &Model) -> State {
    let mut state = state.clone();
    for (lens, set) in [&mut state.camera, &mut state.projector]
        .into_iter()
        .zip(model)
    {
        for (k, free) in lens.distortion.iter_mut().zip(set) {
            *k = if *free { *k } else { 0.0 };
        }
    }
    state
}

/// Models that the choice allows within `largest`, best first. `covariance` is the covariance of the
/// free unknowns of `largest`, the model in which `state` was fitted to `count` scalar observations.
pub(super) fn ranked(
    choice: [Coefficients; 2],
    largest: &Model,
    state: &State,
    covariance: &DMatrix<f64>,
    count: usize,
) -> Vec<Model> {
    let values = [state.camera.distortion, state.projector.distortion];
    let all = free(largest);
    // Index of a coefficient in the covariance.
    let place = |lens: usize, k: usize| (0..lens * LENS + 4 + k).filter(|i| all[*i]).count();
    let penalty = (count as f64).ln().max(LEAST_PENALTY);
    let mut models: Vec<(f64, Model)> = Vec::new();
    let within = |set: &[bool; 5], lens: usize| (0..5).all(|k| largest[lens][k] || !set[k]);
    for camera in choice[0].ladder().into_iter().filter(|s| within(s, 0)) {
        for projector in choice[1].ladder().into_iter().filter(|s| within(s, 1)) {
            let model = [camera, projector];
            let (mut at, mut value, mut kept) = (Vec::new(), Vec::new(), 0);
            for lens in 0..2 {
                for k in 0..5 {
                    if model[lens][k] {
                        kept += 1;
                    } else if largest[lens][k] {
                        at.push(place(lens, k));
                        value.push(values[lens][k]);
                    }
                }
            }
            let block = DMatrix::from_fn(at.len(), at.len(), |i, j| covariance[(at[i], at[j])]);
            let value = DVector::from_vec(value);
            let Some(factor) = block.cholesky() else {
                continue;
            };
            let rise = value.dot(&factor.solve(&value));
            models.push((rise + penalty * f64::from(kept), model));
        }
    }
    models.sort_by(|a, b| a.0.total_cmp(&b.0));
    models.into_iter().map(|(_, model)| model).collect()
}
