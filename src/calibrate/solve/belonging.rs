//! Excludes poses that are inconsistent with the others.

use super::bundle::Bundle;
use super::model::{State, residual};
use super::{LeftOut, Unfit, Unsolved, robust};
use phasmid_core::statistics::median;

/// Maximum robust scale of a pose relative to the median pose. At this scale half of the pose's
/// points are beyond the outlier threshold.
pub(super) const OUTLYING_POSE: f64 = robust::OUTLYING / robust::MEDIAN;

impl Bundle {
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

    /// Excludes the worst pose if its residuals exceed the threshold. Returns whether it did.
    pub(super) fn drop_worst(&mut self, state: &mut State) -> bool {
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
}
