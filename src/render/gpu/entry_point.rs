//! One entry point of one shader, specialised by the plan.

use crate::{Plan, Term};

/// Number of threads per workgroup, as in `plan.wgsl`.
const GROUP: u64 = 64;
/// Maximum number of workgroups along one dimension of a grid.
const MOST_GROUPS: u64 = 65535;

/// An entry point with its pipeline constants.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct EntryPoint {
    pub(super) shader: &'static str,
    pub(super) entry: &'static str,
    pub(super) plan: Plan,
    pub(super) constants: Vec<(&'static str, f64)>,
}

impl EntryPoint {
    pub(crate) fn new(shader: &'static str, entry: &'static str, plan: &Plan) -> Self {
        Self {
            shader,
            entry,
            plan: *plan,
            constants: Vec::new(),
        }
    }

    /// Sets an `override` constant that the shader declares in addition to the constants of
    /// `plan.wgsl`.
    #[must_use]
    pub(crate) fn with(mut self, name: &'static str, value: f64) -> Self {
        self.constants.push((name, value));
        self
    }

    /// Returns all constants: one for each term of the plan, and the constants set by
    /// [`Self::with`].
    pub(super) fn all_constants(&self) -> Vec<(String, f64)> {
        let of_plan = Term::ALL
            .into_iter()
            .filter(|&term| self.plan.has(term))
            .map(|term| (format!("has_{term}").replace('-', "_"), 1.0));
        let own = self.constants.iter().map(|&(n, v)| (n.to_owned(), v));
        of_plan.chain(own).collect()
    }
}

/// Returns a grid of workgroups with at least `count` threads.
pub(crate) fn grid(count: usize) -> [u32; 3] {
    let groups = (count as u64).div_ceil(GROUP).max(1);
    let rows = groups.div_ceil(MOST_GROUPS);
    [groups.div_ceil(rows) as u32, rows as u32, 1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_holds_all_and_is_within_limits() {
        for count in [0, 1, 64, 65, 65535 * 64, 65535 * 64 + 1, 1 << 32] {
            let [columns, rows, _] = grid(count).map(u64::from);
            assert!(columns * rows * GROUP >= count as u64, "{count}");
            assert!(columns * rows * GROUP < count as u64 + (rows + 1) * GROUP);
            assert!(columns <= MOST_GROUPS && rows <= MOST_GROUPS);
        }
    }
}
