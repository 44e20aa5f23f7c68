//! Poses as therapists read them: three translations and three rotations of IEC 61217.
//!
//! The room frame is the fixed frame of IEC 61217: x to the right as seen from the foot end towards the
//! gantry, y to the gantry, z up, with its origin at the isocentre. Couch directions are named LAT (x),
//! LNG (y) and VRT (z). Yaw is the rotation of the patient support about z, pitch is the rotation of the
//! table top about its x axis, roll is its rotation about its y axis, all right-handed (clockwise as
//! seen along the positive axis). The chain of coordinate systems is: fixed frame, patient support,
//! table top; and pitch is applied before roll (DICOM PS3.3, C.8.8.14.12), so `R = Rz(yaw) Rx(pitch)
//! Ry(roll)`.

use glam::{DMat3, DVec3};
use nalgebra::Matrix6;
use phasmid_geometry::Pose;
use std::fmt;

/// Names of the six degrees of freedom, in the order of this module's arrays.
pub const NAMES: [&str; 6] = ["LAT", "LNG", "VRT", "pitch", "roll", "yaw"];

/// A displacement of the patient from the reference, about the isocentre.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SixDof {
    /// LAT, LNG and VRT in millimetres: the position of the patient's point that was planned at the
    /// isocentre.
    pub translation_mm: DVec3,
    /// Pitch, roll and yaw in degrees; pitch is within +-90.
    pub rotation_deg: DVec3,
}

impl SixDof {
    /// Converts a `room_from_reference` pose.
    pub fn of(pose: &Pose) -> Self {
        // The third row of Rz Rx Ry is (-cos x sin y, sin x, cos x cos y), the second column (-sin z
        // cos x, cos z cos x, sin x).
        let m = pose.rotation;
        let pitch = m.y_axis.z.clamp(-1.0, 1.0).asin();
        // At a pitch of +-90 degrees roll and yaw share one axis: the rotation is assigned to roll.
        let (roll, yaw) = if m.y_axis.z.abs() < 1.0 - 1e-12 {
            (
                (-m.x_axis.z).atan2(m.z_axis.z),
                (-m.y_axis.x).atan2(m.y_axis.y),
            )
        } else {
            (m.z_axis.x.atan2(m.x_axis.x), 0.0)
        };
        let degrees = 180.0 / std::f64::consts::PI;
        Self {
            translation_mm: pose.translation_mm,
            rotation_deg: DVec3::new(pitch, roll, yaw) * degrees,
        }
    }

    /// Converts to a `room_from_reference` pose.
    pub fn pose(&self) -> Pose {
        let r = self.rotation_deg * (std::f64::consts::PI / 180.0);
        Pose {
            rotation: DMat3::from_rotation_z(r.z)
                * DMat3::from_rotation_x(r.x)
                * DMat3::from_rotation_y(r.y),
            translation_mm: self.translation_mm,
        }
    }

    /// Computes the couch movement that corrects this displacement: the inverse pose.
    #[must_use]
    pub fn correction(&self) -> Self {
        Self::of(&self.pose().inverse())
    }

    /// Returns the six numbers in the order of [`NAMES`].
    pub fn to_array(&self) -> [f64; 6] {
        let (t, r) = (self.translation_mm, self.rotation_deg);
        [t.x, t.y, t.z, r.x, r.y, r.z]
    }

    /// Computes the standard deviations in the order of [`NAMES`], in millimetres and degrees, from a
    /// covariance of translation (mm) and rotation vector (rad, along the room's axes).
    pub fn deviations(&self, covariance: &Matrix6<f64>) -> [f64; 6] {
        let degrees = 180.0 / std::f64::consts::PI;
        let r = self.rotation_deg / degrees;
        // Each angle rotates about its axis as rotated by the angles applied after it.
        let support = DMat3::from_rotation_z(r.z);
        let top = support * DMat3::from_rotation_x(r.x);
        let axes = DMat3::from_cols(support.x_axis, top.y_axis, DVec3::Z);
        let back = if axes.determinant().abs() > 1e-6 {
            axes.inverse()
        } else {
            DMat3::IDENTITY
        };
        let mut found = [0.0; 6];
        for k in 0..3 {
            found[k] = covariance[(k, k)].max(0.0).sqrt();
            let row = back.row(k).to_array();
            let mut variance = 0.0;
            for i in 0..3 {
                for j in 0..3 {
                    variance += row[i] * row[j] * covariance[(3 + i, 3 + j)];
                }
            }
            found[3 + k] = variance.max(0.0).sqrt() * degrees;
        }
        found
    }
}

impl fmt::Display for SixDof {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let values = self.to_array();
        for (i, (name, value)) in NAMES.iter().zip(values).enumerate() {
            let unit = if i < 3 { "mm" } else { "deg" };
            let comma = if i > 0 { ", " } else { "" };
            write!(f, "{comma}{name} {value:.2} {unit}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_geometry::rotation::exp;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn six_numbers_of_a_pose_give_the_same_pose(t in proptest::array::uniform3(-50.0_f64..50.0),
            pitch in -89.9_f64..89.9, roll in -179.0_f64..179.0, yaw in -179.0_f64..179.0)
        {
            let six = SixDof {
                translation_mm: DVec3::from_array(t),
                rotation_deg: DVec3::new(pitch, roll, yaw),
            };
            let back = SixDof::of(&six.pose());
            prop_assert!((back.rotation_deg - six.rotation_deg).length() < 1e-6);
            let none = six.correction().pose() * six.pose();
            prop_assert!(none.translation_mm.length() < 1e-9);
        }
    }

    #[test]
    fn a_right_angle_of_pitch_is_a_pose_still() {
        for pitch in [-90.0, 90.0] {
            let six = SixDof {
                rotation_deg: DVec3::new(pitch, 20.0, 30.0),
                ..SixDof::default()
            };
            let back = SixDof::of(&six.pose()).pose();
            let off = back.rotation - six.pose().rotation;
            assert!(off.to_cols_array().iter().all(|x| x.abs() < 1e-6), "{off}");
        }
    }

    #[test]
    fn directions_are_those_of_the_standard() {
        // Yaw moves the head (y) to the left (-x) as seen facing the gantry.
        let yaw = SixDof {
            rotation_deg: DVec3::Z * 90.0,
            ..SixDof::default()
        };
        assert!((yaw.pose().point(DVec3::Y) + DVec3::X).length() < 1e-12);
        // Pitch lifts the head, roll lowers the right side of the couch.
        let pitch = SixDof {
            rotation_deg: DVec3::X * 90.0,
            ..SixDof::default()
        };
        assert!((pitch.pose().point(DVec3::Y) - DVec3::Z).length() < 1e-12);
        let roll = SixDof {
            rotation_deg: DVec3::Y * 90.0,
            ..SixDof::default()
        };
        assert!((roll.pose().point(DVec3::X) + DVec3::Z).length() < 1e-12);
    }

    #[test]
    fn deviations_follow_the_angles() {
        // Compared with finite differences: a small rotation vector changes the three angles as
        // predicted.
        let six = SixDof {
            rotation_deg: DVec3::new(20.0, -30.0, 50.0),
            ..SixDof::default()
        };
        let step = 1e-6;
        for axis in 0..3 {
            let mut vector = DVec3::ZERO;
            vector[axis] = step;
            let mut covariance = Matrix6::zeros();
            covariance[(3 + axis, 3 + axis)] = step * step;
            let turned = Pose {
                rotation: exp(vector) * six.pose().rotation,
                ..Pose::IDENTITY
            };
            let moved = SixDof::of(&turned).rotation_deg - six.rotation_deg;
            let told = six.deviations(&covariance);
            for k in 0..3 {
                assert!((told[3 + k] - moved[k].abs()).abs() < 1e-9, "{axis} {k}");
            }
        }
    }
}
