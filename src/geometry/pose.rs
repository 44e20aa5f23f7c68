//! Rigid poses. A pose `a_from_b` maps coordinates in b to coordinates in a.

use crate::Vector3;
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// A rigid motion: rotation, then translation in millimetres.
///
/// ```
/// use phasmid_geometry::Pose;
///
/// // A quarter turn about z, then a shift along x.
/// let pose = Pose::from_xyz_deg([10.0, 0.0, 0.0], [0.0, 0.0, 90.0]);
/// let [x, y, z] = pose.point([1.0, 0.0, 0.0]);
/// assert!((x - 10.0).abs() < 1e-12 && (y - 1.0).abs() < 1e-12 && z == 0.0);
/// assert_eq!(Pose::new(pose.rotation(), pose.translation_mm()), pose);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    // Serialised as three rows.
    #[doc(hidden)]
    #[serde(with = "rows")]
    pub rotation: DMat3,
    #[doc(hidden)]
    #[serde(deserialize_with = "phasmid_core::numbers::exactly")]
    pub translation_mm: DVec3,
}

impl Pose {
    /// The identity pose.
    pub const IDENTITY: Self = Self {
        rotation: DMat3::IDENTITY,
        translation_mm: DVec3::ZERO,
    };

    /// Creates a pose from the rows of a rotation matrix and a translation in millimetres.
    pub fn new(rotation: [[f64; 3]; 3], translation_mm: [f64; 3]) -> Self {
        Self {
            rotation: DMat3::from_cols_array_2d(&rotation).transpose(),
            translation_mm: translation_mm.into(),
        }
    }

    /// Returns the rows of the rotation matrix.
    pub fn rotation(&self) -> [[f64; 3]; 3] {
        self.rotation.transpose().to_cols_array_2d()
    }

    /// Returns the translation in millimetres.
    pub fn translation_mm(&self) -> [f64; 3] {
        self.translation_mm.to_array()
    }

    /// Creates a pose from a position in millimetres and rotations in degrees about the fixed x,
    /// then y, then z axis: R = Rz Ry Rx.
    pub fn from_xyz_deg<V: Vector3>(position_mm: V, rotation_deg: V) -> Self {
        let r = rotation_deg.to_glam() * (std::f64::consts::PI / 180.0);
        Self {
            rotation: DMat3::from_rotation_z(r.z)
                * DMat3::from_rotation_y(r.y)
                * DMat3::from_rotation_x(r.x),
            translation_mm: position_mm.to_glam(),
        }
    }

    /// Returns the position and the rotations from which [`Self::from_xyz_deg`] makes this pose. If
    /// the rotation about y is +-90 degrees, the rotation about z is 0.
    pub fn to_xyz_deg(&self) -> ([f64; 3], [f64; 3]) {
        let m = self.rotation;
        // For R = Rz Ry Rx, the third row is -sin y, cos y sin x, cos y cos x.
        let y = (-m.x_axis.z).atan2(m.y_axis.z.hypot(m.z_axis.z));
        let (x, z) = match m.y_axis.z.hypot(m.z_axis.z) > 1e-12 {
            true => (m.y_axis.z.atan2(m.z_axis.z), m.x_axis.y.atan2(m.x_axis.x)),
            // Ry(+-90) Rx has cos x and sin x in its second row.
            false => ((-m.z_axis.y).atan2(m.y_axis.y), 0.0),
        };
        let turns = DVec3::new(x, y, z) * (180.0 / std::f64::consts::PI);
        (self.translation_mm(), turns.to_array())
    }

    /// Maps a point in b to a.
    #[inline]
    pub fn point<V: Vector3>(&self, p: V) -> V {
        V::from_glam(self.rotation * p.to_glam() + self.translation_mm)
    }

    /// Maps a direction in b to a.
    #[inline]
    pub fn direction<V: Vector3>(&self, d: V) -> V {
        V::from_glam(self.rotation * d.to_glam())
    }

    /// Returns `b_from_a` for an `a_from_b`.
    #[inline]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        Self {
            rotation,
            translation_mm: -(rotation * self.translation_mm),
        }
    }
}

/// `a_from_b * b_from_c` is `a_from_c`.
impl std::ops::Mul for Pose {
    type Output = Self;
    fn mul(self, rhs: Self) -> Self {
        Self {
            rotation: self.rotation * rhs.rotation,
            translation_mm: self.point(rhs.translation_mm),
        }
    }
}

mod rows {
    use glam::DMat3;
    use serde::{Deserializer, Serialize, Serializer};

    pub fn serialize<S: Serializer>(m: &DMat3, s: S) -> Result<S::Ok, S::Error> {
        m.transpose().to_cols_array_2d().serialize(s)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<DMat3, D::Error> {
        phasmid_core::numbers::exactly(d)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_times_pose_is_identity() {
        let pose = Pose::from_xyz_deg(DVec3::new(1.0, -2.0, 3e4), DVec3::new(10.0, 200.0, -33.0));
        let p = DVec3::new(0.3, 7.0, -11.0);
        let back = (pose.inverse() * pose).point(p);
        assert!((back - p).length() < 1e-10, "{back}");
    }

    #[test]
    fn angles_of_a_pose_give_the_same_pose() {
        let angles = [-170.0, -90.0, -33.0, 0.0, 20.0, 90.0, 180.0];
        for x in angles {
            for y in angles {
                for z in angles {
                    let pose = Pose::from_xyz_deg(DVec3::X, DVec3::new(x, y, z));
                    let (position, rotation) = pose.to_xyz_deg();
                    let back = Pose::from_xyz_deg(position, rotation);
                    let off = (back.rotation - pose.rotation).to_cols_array();
                    let worst = off.iter().fold(0.0_f64, |m, o| m.max(o.abs()));
                    assert!(worst < 1e-12, "{x} {y} {z}: {rotation:?}");
                }
            }
        }
    }

    #[test]
    fn rotation_order_is_x_then_y_then_z() {
        let pose = Pose::from_xyz_deg(DVec3::ZERO, DVec3::new(90.0, 0.0, 90.0));
        // The first rotation maps y to z, and the second leaves z unchanged.
        assert!((pose.point(DVec3::Y) - DVec3::Z).length() < 1e-15);
    }
}
