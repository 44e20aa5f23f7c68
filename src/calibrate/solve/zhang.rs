//! Camera intrinsics and board poses from homographies, in closed form.
//!
//! Zhang, "A flexible new technique for camera calibration", IEEE PAMI 22 (2000), section 3.1 and
//! appendix B, without skew: with B = K^-T K^-1, the columns h1 and h2 of a homography satisfy h1'
//! B h2 = 0 and h1' B h1 = h2' B h2. Images are scaled to about [-1, 1] and homographies to columns
//! of about unit length first. The equations may have no solution if there are few poses or little
//! tilt, so there are further candidates: one with the principal point fixed at the image centre,
//! and a series of focal lengths. The candidate whose poses fit best is chosen.

use super::homography::{apply, null_vector};
use glam::{DMat3, DVec2, DVec3};
use nalgebra::{Matrix2, SMatrix, Vector2};
use phasmid_core::statistics::median;
use phasmid_geometry::rotation::nearest;
use phasmid_geometry::{Lens, Pose};

/// Candidate lenses without distortion that could produce these homographies, most reliable first.
pub(super) fn candidates(maps: &[DMat3], size_px: [u32; 2]) -> Vec<Lens> {
    let size = DVec2::new(f64::from(size_px[0]), f64::from(size_px[1]));
    let (middle, scale) = ((size - 1.0) / 2.0, size.max_element() / 2.0);
    let to_unit = DMat3::from_cols(
        DVec3::X / scale,
        DVec3::Y / scale,
        (-middle / scale).extend(1.0),
    );
    let maps: Vec<DMat3> = maps
        .iter()
        .map(|h| {
            let h = to_unit * *h;
            h * (2.0 / (h.x_axis.length() + h.y_axis.length()))
        })
        .collect();
    let lens = |focal: DVec2, principal: DVec2| Lens {
        width_px: size_px[0],
        height_px: size_px[1],
        focal_px: focal * scale,
        principal_px: principal * scale + middle,
        distortion: [0.0; 5],
    };
    let mut found = Vec::new();
    found.extend(all_four(&maps).map(|(f, c)| lens(f, c)));
    found.extend(centred(&maps).map(|f| lens(f, DVec2::ZERO)));
    found
        .extend((0..24).map(|i| lens(DVec2::splat(0.1 * f64::from(i).exp2().sqrt()), DVec2::ZERO)));
    found.retain(|l| l.focal_px.is_finite() && l.focal_px.min_element() > 0.0);
    found.retain(|l| l.principal_px.is_finite());
    found
}

/// Computes focal lengths and principal point (scaled units) from the unknowns B11, B22, B13, B23,
/// B33.
fn all_four(maps: &[DMat3]) -> Option<(DVec2, DVec2)> {
    let mut normal = SMatrix::<f64, 5, 5>::zeros();
    for h in maps {
        let row = |a: DVec3, b: DVec3| {
            [
                a.x * b.x,
                a.y * b.y,
                a.x * b.z + a.z * b.x,
                a.y * b.z + a.z * b.y,
                a.z * b.z,
            ]
        };
        let [one, two] = [row(h.x_axis, h.x_axis), row(h.y_axis, h.y_axis)];
        let rows = [
            row(h.x_axis, h.y_axis),
            std::array::from_fn(|i| one[i] - two[i]),
        ];
        for row in rows {
            for i in 0..5 {
                for j in 0..5 {
                    normal[(i, j)] += row[i] * row[j];
                }
            }
        }
    }
    let [b11, b22, b13, b23, b33] = null_vector(normal, 1e-14)?;
    let principal = DVec2::new(-b13 / b11, -b23 / b22);
    let rest = b33 - b13 * b13 / b11 - b23 * b23 / b22;
    Some((
        DVec2::new((rest / b11).sqrt(), (rest / b22).sqrt()),
        principal,
    ))
}

/// Focal lengths (scaled units) by least squares, with the principal point at the image centre.
fn centred(maps: &[DMat3]) -> Option<DVec2> {
    let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for h in maps {
        let (a, b) = (h.x_axis, h.y_axis);
        let rows = [
            (a.x * b.x, a.y * b.y, -a.z * b.z),
            (
                a.x * a.x - b.x * b.x,
                a.y * a.y - b.y * b.y,
                b.z * b.z - a.z * a.z,
            ),
        ];
        for (x, y, r) in rows {
            let row = Vector2::new(x, y);
            normal += row * row.transpose();
            right += row * r;
        }
    }
    let inverse_squares = normal.try_inverse()? * right;
    Some(DVec2::new(
        1.0 / inverse_squares.x.sqrt(),
        1.0 / inverse_squares.y.sqrt(),
    ))
}

/// Pose of the board (`view_from_board`) for a lens without distortion. Returns `None` if the board
/// would be behind the lens.
pub(super) fn pose(lens: &Lens, map: &DMat3) -> Option<Pose> {
    let (f, c) = (lens.focal_px, lens.principal_px);
    let to_ray = DMat3::from_cols(DVec3::X / f.x, DVec3::Y / f.y, (-c / f).extend(1.0));
    let m = to_ray * *map;
    let scale = 2.0 / (m.x_axis.length() + m.y_axis.length());
    let (x, y) = (m.x_axis * scale, m.y_axis * scale);
    let rotation = nearest(DMat3::from_cols(x, y, x.cross(y)))?;
    let translation_mm = m.z_axis * scale;
    (translation_mm.is_finite() && translation_mm.z > 0.0).then_some(Pose {
        rotation,
        translation_mm,
    })
}

/// Candidate whose poses agree best with the homographies, and its misfit: the median over the
/// poses of the RMS distance (pixels) at `points` on the boards (mm).
pub(super) fn best(
    maps: &[DMat3],
    points: &[Vec<DVec2>],
    size_px: [u32; 2],
) -> Option<(Lens, f64)> {
    candidates(maps, size_px)
        .into_iter()
        .filter_map(|lens| {
            let mut misfits: Vec<f64> = maps
                .iter()
                .zip(points)
                .map(|(map, points)| misfit(&lens, map, points))
                .collect();
            Some((lens, median(&mut misfits)?))
        })
        .filter(|(_, misfit)| misfit.is_finite())
        .min_by(|a, b| a.1.total_cmp(&b.1))
}

fn misfit(lens: &Lens, map: &DMat3, points: &[DVec2]) -> f64 {
    let Some(pose) = pose(lens, map) else {
        return f64::INFINITY;
    };
    let sum: f64 = points
        .iter()
        .map(|p| {
            lens.project(pose.point(p.extend(0.0)))
                .map_or(f64::INFINITY, |px| (px - apply(map, *p)).length_squared())
        })
        .sum();
    (sum / points.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(lens: &Lens, pose: &Pose) -> DMat3 {
        let k = DMat3::from_cols(
            DVec3::X * lens.focal_px.x,
            DVec3::Y * lens.focal_px.y,
            lens.principal_px.extend(1.0),
        );
        let r = pose.rotation;
        k * DMat3::from_cols(r.x_axis, r.y_axis, pose.translation_mm)
    }

    fn lens(focal: f64) -> Lens {
        Lens {
            width_px: 1138,
            height_px: 489,
            focal_px: DVec2::new(focal, 1.01 * focal),
            principal_px: DVec2::new(571.0, 240.0),
            distortion: [0.0; 5],
        }
    }

    fn boards(count: usize, distance: f64) -> Vec<Pose> {
        let tilts = [(30.0, 0.0), (0.0, 30.0), (-25.0, 20.0), (15.0, -35.0)];
        tilts[..count]
            .iter()
            .map(|(a, b)| {
                let at = DVec3::new(a * 0.2, -b * 0.3, distance);
                Pose::from_xyz_deg(at, DVec3::new(*a, *b, a + b))
            })
            .collect()
    }

    #[test]
    fn exact_homographies_give_exact_lens_and_poses() {
        for (focal, distance) in [(632.0, 1000.0), (5.0, 80.0), (1e5, 1e5)] {
            let (lens, boards) = (lens(focal), boards(4, distance));
            let maps: Vec<DMat3> = boards.iter().map(|b| map(&lens, b)).collect();
            let (f, c) = (lens.focal_px, lens.principal_px);
            let found = candidates(&maps, [1138, 489])[0];
            assert!(((found.focal_px - f) / f).length() < 1e-5, "{found:?}");
            assert!(
                (found.principal_px - c).length() < 1e-5 * focal,
                "{found:?}"
            );
            let points = vec![vec![DVec2::ZERO, DVec2::new(9.0, 3.0), DVec2::new(-9.0, 7.0)]; 4];
            let (found, misfit) = best(&maps, &points, [1138, 489]).unwrap();
            assert!(misfit < 1e-4, "{misfit}");
            for (map, board) in maps.iter().zip(&boards) {
                let pose = pose(&found, map).unwrap();
                let off = (pose.translation_mm - board.translation_mm).length();
                assert!(off < 1e-4 * distance, "{focal} {off}");
            }
        }
    }

    #[test]
    fn two_poses_and_none_still_give_a_guess() {
        let boards = boards(1, 800.0);
        let maps: Vec<DMat3> = boards.iter().map(|b| map(&lens(600.0), b)).collect();
        assert!(!candidates(&maps, [1138, 489]).is_empty());
        assert!(!candidates(&[], [1, 1]).is_empty());
        assert!(best(&[], &[], [1138, 489]).is_none());
    }
}
