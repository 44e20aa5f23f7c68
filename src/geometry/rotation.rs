//! Rotation vectors, small steps of poses, and the rotation nearest to a matrix.

use crate::Pose;
use glam::{DMat3, DQuat, DVec3};
use nalgebra::Matrix3;

/// Rotation matrix of a rotation vector in radians.
pub fn exp(turn: DVec3) -> DMat3 {
    let angle = turn.length();
    turn.try_normalize()
        .map_or(DMat3::IDENTITY, |axis| DMat3::from_axis_angle(axis, angle))
}

/// Rotation vector of a rotation matrix, in radians, of length up to pi.
pub fn log(r: DMat3) -> DVec3 {
    // `v` is the sine of the angle times the axis.
    let v = DVec3::new(
        r.y_axis.z - r.z_axis.y,
        r.z_axis.x - r.x_axis.z,
        r.x_axis.y - r.y_axis.x,
    ) / 2.0;
    let cosine = (r.x_axis.x + r.y_axis.y + r.z_axis.z - 1.0) / 2.0;
    let sine = v.length();
    if cosine > -0.9 {
        let stretch = if sine > 0.0 {
            sine.atan2(cosine) / sine
        } else {
            1.0
        };
        return v * stretch;
    }
    // Near a half turn the sine vanishes, so take the axis from the quaternion.
    let q = DQuat::from_mat3(&r);
    let q = if q.w < 0.0 { -q } else { q };
    let half = q.xyz();
    half.try_normalize()
        .map_or(DVec3::ZERO, |axis| axis * (2.0 * half.length().atan2(q.w)))
}

/// Rotates a pose by `turn` (radians, about the axes of the target frame) and shifts it by `shift`
/// (mm).
pub fn nudge(pose: &Pose, turn: DVec3, shift: DVec3) -> Pose {
    Pose {
        rotation: orthonormal(exp(turn) * pose.rotation),
        translation_mm: pose.translation_mm + shift,
    }
}

/// Rotation vector and shift with which [`nudge`] changes one pose to another.
pub fn difference(from: &Pose, to: &Pose) -> [f64; 6] {
    let turn = log(to.rotation * from.rotation.transpose());
    let shift = to.translation_mm - from.translation_mm;
    [turn.x, turn.y, turn.z, shift.x, shift.y, shift.z]
}

/// Removes rounding errors from a rotation matrix (Gram-Schmidt).
pub fn orthonormal(m: DMat3) -> DMat3 {
    let x = m.x_axis.normalize();
    let y = (m.y_axis - x * x.dot(m.y_axis)).normalize();
    DMat3::from_cols(x, y, x.cross(y))
}

/// Rotation nearest to a matrix in the least-squares sense (Zhang 2000, appendix C). Returns `None`
/// if the matrix is not finite.
pub fn nearest(m: DMat3) -> Option<DMat3> {
    if !m.is_finite() {
        return None;
    }
    let svd = Matrix3::from_column_slice(&m.to_cols_array()).try_svd(true, true, 1e-15, 200)?;
    let (u, vt) = (svd.u?, svd.v_t?);
    let flip = (u * vt).determinant().signum();
    let r = u * Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, 1.0, flip)) * vt;
    let r = DMat3::from_cols_slice(r.as_slice());
    r.is_finite().then_some(r)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_goes_there_and_back() {
        for length in [0.0, 1e-12, 1e-7, 0.3, 2.0, 2.9, 3.1, std::f64::consts::PI] {
            for axis in [
                DVec3::X,
                DVec3::new(-0.6, 0.0, 0.8),
                DVec3::new(0.48, 0.6, -0.64),
            ] {
                let turn = axis * length;
                let back = log(exp(turn));
                let same = (back - turn).length() < 1e-9 * (1e-6 + length);
                // Half a turn either way is the same rotation.
                assert!(
                    same || (length > 3.11 && (back + turn).length() < 1e-6),
                    "{turn} {back}"
                );
            }
        }
    }

    #[test]
    fn the_nearest_rotation_of_a_rotation_is_itself() {
        let r = exp(DVec3::new(0.4, -1.0, 0.2));
        assert!((nearest(r * 3.0).unwrap() - r).abs_diff_eq(DMat3::ZERO, 1e-14));
        assert!(nearest(r * -1.0).unwrap().determinant() > 0.0);
        assert!(nearest(DMat3::NAN).is_none());
    }
}
