//! How far residuals scatter, by the light that makes their noise.

use phasmid_decode::deviation;

/// Groups of about as much light.
const GROUPS: usize = 24;
/// Least deviation in DN: rounding.
const ROUNDING_DN: f64 = 0.3;
/// Least deviation to begin with: residuals of whole numbers may have a median of 0.
const FIRST_DN: f64 = 1.0;

/// A group's variance is no more than so many times the middle one's, and that of shot noise by its light:
/// rows of one brightness may all be damaged.
const MOST: f64 = 4.0;

/// Variance by light, linear between groups, for points in order of their light.
pub(super) struct Noise<'a> {
    points: &'a [(f64, f64)],
    groups: Vec<(f64, f64)>,
}

impl<'a> Noise<'a> {
    /// Of points of light and residual, in order of their light; at least one.
    pub(super) fn of(points: &'a [(f64, f64)]) -> Self {
        let size = points.len().div_ceil(GROUPS).max(1);
        let mut groups: Vec<(f64, f64)> = points.chunks(size).map(group).collect();
        let middle = groups.len() / 2;
        let mut variances: Vec<f64> = groups.iter().map(|(_, variance)| *variance).collect();
        let usual = *variances.select_nth_unstable_by(middle, f64::total_cmp).1;
        let light = groups[middle].0.max(1e-9);
        for group in &mut groups {
            group.1 = group.1.min(MOST * usual * (group.0 / light).max(1.0));
        }
        Self { points, groups }
    }

    /// The deviation of each of the points.
    pub(super) fn each(&self) -> Vec<f64> {
        let groups = &self.groups;
        let mut next = 0;
        let deviation = |&(light, _): &(f64, f64)| {
            while next < groups.len() && groups[next].0 < light {
                next += 1;
            }
            let variance = match (next.checked_sub(1), groups.get(next)) {
                (Some(before), Some((to, high))) => {
                    let (from, low) = groups[before];
                    low + (high - low) * (light - from) / (to - from).max(1e-9)
                }
                (Some(last), None) => groups[last].1,
                (None, _) => groups[0].1,
            };
            variance.sqrt()
        };
        self.points.iter().map(deviation).collect()
    }
}

/// Middle light and variance of a group.
fn group(points: &[(f64, f64)]) -> (f64, f64) {
    let mut sizes: Vec<f64> = points.iter().map(|p| p.1.abs()).collect();
    let deviation = deviation::of_most(&mut sizes, FIRST_DN, ROUNDING_DN);
    (points[points.len() / 2].0, deviation * deviation)
}
