//! The stages of bundle adjustment from a start to the minimum: robust approach, exclusion of poses that
//! are inconsistent with the others, outlier rejection and noise estimation.

use super::coefficients::{Model, free, restricted};
use super::fit::{Effort, minimise};
use super::model::{State, residual};
use super::normal::{Free, Normal};
use super::observation::PoseObservations;
use super::refusal::{Why, refusal};
use super::robust::{self, Loss, OUTLYING_POSE};
use super::{Choice, Coefficients, LeftOut, PoseSightings, Unfit, Unsolved};
use nalgebra::DMatrix;
use phasmid_core::Stop;
use phasmid_core::statistics::median;
use phasmid_geometry::Board;

/// The poses in use and the excluded ones.
#[derive(Clone)]
pub(super) struct Bundle {
    pub poses: Vec<PoseObservations>,
    pub left_out: Vec<LeftOut>,
    /// Ends the minimisations early.
    pub stop: Stop,
}

/// Result of `Bundle::solve`.
pub(super) struct Solved {
    pub state: State,
    pub model: Model,
    /// Covariance of the rig's free unknowns, then six unknowns per board.
    pub covariance: DMatrix<f64>,
    pub inflation: [f64; 2],
}

/// Result of `Bundle::settle`: the minimum for one selection of free unknowns.
pub(super) struct Settled {
    pub state: State,
    /// Covariance of the rig's free unknowns, then six unknowns per board.
    pub covariance: DMatrix<f64>,
    pub inflation: [f64; 2],
}

impl Settled {
    pub fn of(self, model: Model) -> Solved {
        Solved {
            state: self.state,
            model,
            covariance: self.covariance,
            inflation: self.inflation,
        }
    }
}

impl Bundle {
    pub fn new(board: &Board, poses: &[PoseSightings]) -> Self {
        Self {
            poses: poses
                .iter()
                .enumerate()
                .map(|(i, p)| PoseObservations::new(board, p, i))
                .collect(),
            left_out: Vec::new(),
            stop: Stop::default(),
        }
    }

    /// Number of scalar observations in use.
    pub fn observed(&self) -> usize {
        let points = self.poses.iter().flat_map(|p| &p.points);
        points
            .map(|o| 2 * (usize::from(o.camera_counts) + usize::from(o.projector_counts)))
            .sum()
    }

    /// Fits the models in the given order (larger models first) and returns the first fit that the
    /// data determine and whose distortion does not fold the image over.
    pub fn largest(
        &mut self,
        state: &State,
        models: &[Model],
        choice: &Choice,
    ) -> Result<Solved, Unsolved> {
        let mut refusal = self.refusal(Why::Open, state);
        for (i, model) in models.iter().enumerate() {
            if models[..i].contains(model) {
                continue;
            }
            let (mut other, mut state) = (self.clone(), restricted(state, model));
            let free = free(model);
            let settled = other
                .approach(&mut state, &free, choice, true)
                .and_then(|()| other.settle(state, &free, choice));
            match settled {
                Ok(settled) if unfolded(&settled.state, model, choice) => {
                    *self = other;
                    return Ok(settled.of(*model));
                }
                Ok(_) => {}
                Err(Unsolved::Interrupted) => return Err(Unsolved::Interrupted),
                Err(why) => refusal = why,
            }
        }
        Err(refusal)
    }

    /// Moves the state close to the minimum with a robust loss. If `drop` is set, excludes poses
    /// that are inconsistent with the others.
    pub fn approach(
        &mut self,
        state: &mut State,
        free: &Free,
        choice: &Choice,
        drop: bool,
    ) -> Result<(), Unsolved> {
        let mut last = f64::INFINITY;
        for _ in 0..8 {
            let scales = robust::scales(&self.poses, state);
            let loss = if choice.robust {
                Loss::huber(scales)
            } else {
                Loss::Square([1.0; 2])
            };
            let fit = minimise(&self.poses, state, free, &loss, Effort::ROUGH, &self.stop)
                .map_err(|why| self.refusal(why, state))?;
            *state = fit.state;
            // Each of the two scales is at least 1, so a sum below 2.1 cannot improve noticeably.
            let now: f64 = robust::scales(&self.poses, state).iter().sum();
            let settled = now > 0.9 * last || now < 2.1;
            last = now;
            let dropped = drop && settled && choice.robust && self.drop_worst(state);
            if dropped {
                last = f64::INFINITY;
            } else if settled || !choice.robust {
                break;
            }
        }
        Ok(())
    }

    /// Finds the least-squares minimum, alternating between outlier rejection, minimisation and
    /// noise estimation.
    pub fn settle(
        &mut self,
        state: State,
        free: &Free,
        choice: &Choice,
    ) -> Result<Settled, Unsolved> {
        let (mut state, mut inflation, mut moved) = (state, [1.0; 2], true);
        for _ in 0..6 {
            let changed = choice.robust && robust::reject(&mut self.poses, &state);
            if !changed && !moved {
                break;
            }
            let loss = Loss::Square(inflation);
            let fit = minimise(&self.poses, &state, free, &loss, Effort::FULL, &self.stop)
                .map_err(|why| self.refusal(why, &state))?;
            state = fit.state;
            if !fit.converged {
                let why = fit.next.map_or(Why::Open, Why::Restless);
                return Err(self.refusal(why, &state));
            }
            let before = inflation;
            inflation = self.inflation(&state, free);
            moved = (0..2).any(|g| (inflation[g] / before[g] - 1.0).abs() > 1e-3);
        }
        if self.degrees_of_freedom(free) == 0 {
            let unknowns = self.unknowns(free);
            return Err(self.refusal(Why::TooFew { unknowns }, &state));
        }
        let covariance = Normal::at(&self.poses, &state, &Loss::Square(inflation))
            .and_then(|n| n.covariance(free))
            .ok_or_else(|| self.refusal(Why::Open, &state))?;
        Ok(Settled {
            state,
            covariance,
            inflation,
        })
    }

    /// Moves a pose to the excluded ones.
    pub fn leave_out(&mut self, at: usize, why: Unfit) {
        let pose = self.poses.remove(at);
        self.left_out.push(LeftOut {
            name: pose.name,
            given: pose.given,
            why,
        });
    }

    /// Returns an error if fewer than two poses are left.
    pub fn enough_poses(&self) -> Result<(), Unsolved> {
        if self.poses.len() >= 2 {
            return Ok(());
        }
        let total = self.poses.len() + self.left_out.len();
        let mut found = format!("{} of {total} can be used", self.poses.len());
        for out in self.left_out.iter().take(8) {
            found += &format!("; {}: {}", out.name, out.why);
        }
        if self.left_out.len() > 8 {
            found += &format!("; and {} more", self.left_out.len() - 8);
        }
        Err(Unsolved::TooFewPoses {
            found,
            wanted: "2 or more tilted in different directions, better 10".to_owned(),
        })
    }

    /// Excludes poses that the initial state puts behind a lens.
    pub(super) fn drop_behind(&mut self, state: &mut State) -> Result<(), Unsolved> {
        for at in (0..self.poses.len()).rev() {
            let points = &self.poses[at].points;
            if points.iter().any(|o| residual(o, state, at).is_none()) {
                self.leave_out(at, Unfit::Behind);
                state.boards.remove(at);
            }
        }
        self.enough_poses()
    }

    /// Excludes the worst pose if its residuals exceed the threshold; returns whether it was excluded.
    fn drop_worst(&mut self, state: &mut State) -> bool {
        let total = self.poses.len() + self.left_out.len();
        // Exclude a pose only if at least four are in use and two thirds of all poses remain.
        if self.poses.len() < 4 || 3 * (self.poses.len() - 1) < 2 * total {
            return false;
        }
        let scales: Vec<[Option<f64>; 2]> = (0..self.poses.len())
            .map(|i| robust::pose_scales(&self.poses[i], state, i))
            .collect();
        let mut worst: Option<(f64, usize, usize)> = None;
        for group in 0..2 {
            let mut all: Vec<f64> = scales.iter().filter_map(|s| s[group]).collect();
            let usual = median(&mut all).unwrap_or(1.0).max(1.0);
            for (i, scale) in scales.iter().enumerate() {
                let ratio = scale[group].map_or(0.0, |s| s / usual);
                if ratio > worst.map_or(OUTLYING_POSE, |w| w.0) {
                    worst = Some((ratio, i, group));
                }
            }
        }
        let Some((ratio, at, group)) = worst else {
            return false;
        };
        let projector = group == 1;
        self.leave_out(at, Unfit::Misfit { projector, ratio });
        state.boards.remove(at);
        true
    }

    /// Sums of squared whitened residuals and numbers of scalar observations, for camera and
    /// projector.
    pub fn squares(&self, state: &State) -> [(f64, usize); 2] {
        let mut sums = [(0.0, 0); 2];
        for (i, pose) in self.poses.iter().enumerate() {
            for o in &pose.points {
                let Some(w) = residual(o, state, i).map(|r| r.whitened(o)) else {
                    continue;
                };
                let parts = [
                    Some(w.camera).filter(|_| o.camera_counts),
                    w.projector.filter(|_| o.projector_counts),
                ];
                for (sum, part) in sums.iter_mut().zip(parts) {
                    sum.0 += part.map_or(0.0, |p| p.length_squared());
                    sum.1 += part.map_or(0, |_| 2);
                }
            }
        }
        sums
    }

    /// Number of scalar observations minus number of unknowns.
    pub fn degrees_of_freedom(&self, free: &Free) -> usize {
        self.observed().saturating_sub(self.unknowns(free))
    }

    /// Number of unknowns: the rig's free ones and six per board.
    fn unknowns(&self, free: &Free) -> usize {
        free.iter().filter(|f| **f).count() + 6 * self.poses.len()
    }

    /// Variance inflation factors for camera and projector: the mean squared whitened residual,
    /// with the degrees of freedom split between the groups in proportion to their observations. A
    /// factor is 1 unless it exceeds 1 by more than three standard deviations, sqrt(2 / n) each.
    fn inflation(&self, state: &State, free: &Free) -> [f64; 2] {
        let share = self.degrees_of_freedom(free) as f64 / self.observed() as f64;
        self.squares(state).map(|(sum, count)| {
            let free = count as f64 * share;
            let factor = sum / free;
            if factor > 1.0 + 3.0 * (2.0 / free).sqrt() && factor.is_finite() {
                factor
            } else {
                1.0
            }
        })
    }

    fn refusal(&self, why: Why, state: &State) -> Unsolved {
        refusal(why, &self.poses, self.observed(), state)
    }
}

/// Whether the distortion of each lens whose coefficients are chosen automatically can be inverted
/// over the whole image.
pub(super) fn unfolded(state: &State, model: &Model, choice: &Choice) -> bool {
    let lenses = [&state.camera, &state.projector];
    let auto = [choice.camera, choice.projector].map(|c| c == Coefficients::Auto);
    (0..2).all(|i| !auto[i] || model[i] == [false; 5] || lenses[i].folds_before().is_none())
}
