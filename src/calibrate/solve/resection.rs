//! Projector intrinsics and pose from points with known positions in space. The projector is
//! modelled as an inverse camera.
//!
//! The camera's intrinsics and the board poses give the illuminated points in the camera's frame. A
//! direct linear transformation then gives the projector's 3 x 4 matrix (Hartley and Zisserman,
//! "Multiple View Geometry in Computer Vision", 2nd edition, algorithm 7.1), which is split into
//! lens and pose by the upper triangular factor K of M M' = K K' (section 6.2.4). Points on planes
//! of several orientations determine the projector better than homographies do, wherever the
//! principal point lies.

use super::homography::null_vector;
use glam::{DMat3, DVec2, DVec3};
use nalgebra::SMatrix;
use phasmid_geometry::rotation::nearest;
use phasmid_geometry::{Lens, Pose};

/// Returns a lens without distortion and `camera_from_projector`, or `None` if the pairs do not
/// determine them. A pair is a point in the camera's frame (mm) and its projector pixel.
pub(super) fn resect(pairs: &[(DVec3, DVec2)], size_px: [u32; 2]) -> Option<(Lens, Pose)> {
    let count = pairs.len() as f64;
    let mean = pairs.iter().map(|p| p.0).sum::<DVec3>() / count;
    let spread = pairs
        .iter()
        .map(|p| (p.0 - mean).length_squared())
        .sum::<f64>()
        / count;
    let scale = (3.0 / spread).sqrt();
    let size = DVec2::new(f64::from(size_px[0]), f64::from(size_px[1]));
    let (middle, half) = ((size - 1.0) / 2.0, size.max_element() / 2.0);

    let mut normal = SMatrix::<f64, 12, 12>::zeros();
    for (point, px) in pairs {
        let p = ((*point - mean) * scale).extend(1.0).to_array();
        let q = (*px - middle) / half;
        let mut rows = [[0.0; 12]; 2];
        for i in 0..4 {
            (rows[0][i], rows[0][8 + i]) = (p[i], -q.x * p[i]);
            (rows[1][4 + i], rows[1][8 + i]) = (p[i], -q.y * p[i]);
        }
        for row in rows {
            for i in 0..12 {
                for j in 0..12 {
                    normal[(i, j)] += row[i] * row[j];
                }
            }
        }
    }
    let p = null_vector(normal, 1e-13)?;
    let column = |j: usize| DVec3::new(p[j], p[4 + j], p[8 + j]);
    let (mut m, mut last) = (DMat3::from_cols(column(0), column(1), column(2)), column(3));
    // Fix the sign: the determinant of a rotation and the focal lengths are positive.
    let sign = m.determinant().signum() / m.row(2).length();
    m *= sign;
    last *= sign;

    let square = m * m.transpose();
    let principal = DVec2::new(square.z_axis.x, square.z_axis.y);
    let fy = (square.y_axis.y - principal.y * principal.y).sqrt();
    let skew = (square.y_axis.x - principal.x * principal.y) / fy;
    let fx = (square.x_axis.x - skew * skew - principal.x * principal.x).sqrt();
    let k = DMat3::from_cols(
        DVec3::new(fx, 0.0, 0.0),
        DVec3::new(skew, fy, 0.0),
        principal.extend(1.0),
    );
    let inverse = k.inverse();
    let rotation = nearest(inverse * m)?;
    let pose = Pose {
        rotation,
        translation_mm: inverse * last / scale - rotation * mean,
    };
    let lens = Lens {
        width_px: size_px[0],
        height_px: size_px[1],
        focal_px: DVec2::new(fx, fy) * half,
        principal_px: principal * half + middle,
        distortion: [0.0; 5],
    };
    let usable = lens.focal_px.is_finite()
        && lens.focal_px.min_element() > 0.0
        && lens.principal_px.is_finite()
        && pose.translation_mm.is_finite()
        && pose.point(mean).z > 0.0;
    usable.then(|| (lens, pose.inverse()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_points_give_the_pose_of_a_shifted_projector() {
        let lens = Lens {
            width_px: 1920,
            height_px: 1080,
            focal_px: DVec2::new(2751.36, 2740.0),
            principal_px: DVec2::new(2060.0, 539.5),
            distortion: [0.0; 5],
        };
        let pose = Pose::from_xyz_deg(DVec3::new(400.0, 3.0, -7.0), DVec3::new(0.3, -4.0, 1.0));
        let pairs: Vec<(DVec3, DVec2)> = (0..200)
            .map(|i| {
                let i = f64::from(i);
                let p = DVec3::new(
                    (i * 0.7).sin() * 250.0,
                    (i * 1.3).cos() * 200.0,
                    1000.0 + (i * 2.1).sin() * 90.0,
                );
                (p, lens.project(pose.inverse().point(p)).unwrap())
            })
            .collect();
        let (found, place) = resect(&pairs, [1920, 1080]).unwrap();
        assert!(
            (found.focal_px - lens.focal_px).length() < 1e-3,
            "{found:?}"
        );
        assert!((found.principal_px - lens.principal_px).length() < 1e-3);
        assert!((place.translation_mm - pose.translation_mm).length() < 1e-3);
        let plane: Vec<_> = pairs.iter().map(|(p, q)| (p.with_z(900.0), *q)).collect();
        assert!(resect(&plane[..3], [1920, 1080]).is_none());
        assert!(resect(&[], [1920, 1080]).is_none());
    }
}
