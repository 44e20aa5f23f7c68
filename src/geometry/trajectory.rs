//! Rigid motion through keyframes.

use super::{Pose, Timeline};
use glam::{DMat3, DQuat, DVec3};

/// A pose over time.
///
/// Positions follow the [`Timeline`]'s splines. Rotations follow the equivalent on unit quaternions:
/// cubic Hermite curves in cumulative form (Kim, Kim, Shin: "A general construction scheme for unit
/// quaternion curves with simple high order derivatives", SIGGRAPH 1995, section 4.2) with the same
/// tangents, so that a rotation at constant speed stays at constant speed. Between two keyframes, the
/// rotation takes the shorter way.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    timeline: Timeline,
    positions_mm: Vec<DVec3>,
    rotations: Vec<DQuat>,
}

impl Trajectory {
    /// Creates a trajectory from a position in millimetres and a rotation for each keyframe of a
    /// timeline; rotations in degrees as for [`Pose::from_xyz_deg`].
    pub fn new(timeline: Timeline, keys: &[(DVec3, DVec3)]) -> Self {
        let rotation = |deg: DVec3| {
            let r = deg * (std::f64::consts::PI / 180.0);
            DQuat::from_rotation_z(r.z) * DQuat::from_rotation_y(r.y) * DQuat::from_rotation_x(r.x)
        };
        Self {
            timeline,
            positions_mm: keys.iter().map(|key| key.0).collect(),
            rotations: keys.iter().map(|key| rotation(key.1)).collect(),
        }
    }

    /// Returns the largest distance of a keyframe position from the origin, in millimetres.
    pub fn reach_mm(&self) -> f64 {
        let lengths = self.positions_mm.iter().map(|p| p.length());
        lengths.fold(0.0, f64::max)
    }

    /// Returns the pose at a time.
    #[inline]
    pub fn pose(&self, time_s: f64) -> Pose {
        let span = self.timeline.span(time_s);
        let weights = span.weights();
        let positions = span.keys.map(|key| self.positions_mm[key]);
        let turns = span.keys.map(|key| self.rotations[key]);
        Pose {
            rotation: DMat3::from_quat(turn(turns, span.times_s, span.share)),
            translation_mm: (0..4).map(|i| positions[i] * weights[i]).sum(),
        }
    }
}

/// Interpolates the rotation between the second and third of four keyframes.
fn turn(keys: [DQuat; 4], times: [f64; 4], share: f64) -> DQuat {
    let steps = [0, 1, 2].map(|i| step(keys[i], keys[i + 1]));
    let length = times[2] - times[1];
    let tangent = |i: usize| {
        let chord = times[i + 2] - times[i];
        if chord > 0.0 {
            (steps[i] + steps[i + 1]) * (length / chord)
        } else {
            DVec3::ZERO
        }
    };
    let (leaving, arriving) = (tangent(0) / 3.0, tangent(1) / 3.0);
    let (first, last) = (
        DQuat::from_scaled_axis(leaving),
        DQuat::from_scaled_axis(arriving),
    );
    let middle = step(keys[1] * first, keys[2] * last.conjugate());
    // Cumulative basis of the cubic Bernstein polynomials.
    let s = share;
    let turned = DQuat::from_scaled_axis(leaving * (1.0 - (1.0 - s).powi(3)))
        * DQuat::from_scaled_axis(middle * (s * s * (3.0 - 2.0 * s)))
        * DQuat::from_scaled_axis(arriving * s.powi(3));
    (keys[1] * turned).normalize()
}

/// Rotation vector, in the moving frame, of the shorter rotation from `from` to `to`.
fn step(from: DQuat, to: DQuat) -> DVec3 {
    let q = from.conjugate() * to;
    let q = if q.w < 0.0 { -q } else { q };
    let (v, sin) = (q.xyz(), q.xyz().length());
    // Limit for angles too small for the quotient; exact to rounding.
    let scale = if sin > 1e-9 {
        2.0 * sin.atan2(q.w) / sin
    } else {
        2.0
    };
    v * scale
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(rotations: &[[f64; 3]]) -> Vec<(DVec3, DVec3)> {
        let key = |deg: &[f64; 3]| (DVec3::new(deg[0], -1.0, 2.0), DVec3::from(*deg));
        rotations.iter().map(key).collect()
    }

    #[test]
    fn passes_through_its_poses_without_a_jerk() {
        let keys = keys(&[[0.0; 3], [30.0, -20.0, 5.0], [80.0, 40.0, -60.0], [0.0; 3]]);
        let times = [0.0, 0.4, 1.0, 2.0];
        let path = Trajectory::new(Timeline::new(times.to_vec(), None), &keys);
        for (t, (position, deg)) in times.into_iter().zip(&keys) {
            let (found, exact) = (path.pose(t), Pose::from_xyz_deg(*position, *deg));
            assert_eq!(found.translation_mm, exact.translation_mm);
            let apart = (found.rotation - exact.rotation).to_cols_array();
            assert!(apart.iter().all(|v| v.abs() < 1e-14), "{t}: {apart:?}");
        }
        assert_eq!(
            path.pose(0.0),
            Pose {
                translation_mm: keys[0].0,
                ..Pose::IDENTITY
            }
        );
        assert_eq!(path.pose(2.0), path.pose(77.0));
        // Angular velocity on both sides of the keyframes, in the body frame.
        let q = |t: f64| DQuat::from_mat3(&path.pose(t).rotation);
        for t in [0.4, 1.0] {
            let h = 1e-6;
            let (left, right) = (step(q(t - h), q(t)) / h, step(q(t), q(t + h)) / h);
            assert!((left - right).length() < 1e-4, "{left} {right}");
        }
        // Rotation matrices stay orthonormal throughout.
        for i in 0..200 {
            let r = path.pose(f64::from(i) / 100.0).rotation;
            let off = r * r.transpose() - DMat3::IDENTITY;
            assert!(off.to_cols_array().iter().all(|v| v.abs() < 1e-14));
        }
    }

    #[test]
    fn an_even_turn_stays_even() {
        let keys = keys(&[
            [0.0; 3],
            [0.0, 20.0, 0.0],
            [0.0, 60.0, 0.0],
            [0.0, 170.0, 0.0],
        ]);
        let line = Timeline::new(vec![0.0, 1.0, 3.0, 8.5], None);
        let path = Trajectory::new(line, &keys);
        for i in 0..85 {
            let t = f64::from(i) / 10.0;
            let exact = DMat3::from_rotation_y((20.0 * t).to_radians());
            let off = (path.pose(t).rotation - exact).to_cols_array();
            assert!(off.iter().all(|v| v.abs() < 1e-13), "{t}: {off:?}");
        }
    }
}
