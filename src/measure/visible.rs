//! Finds the parts of a true surface that a rig can measure: lit by the projector and seen by the
//! camera.

use super::surface::widened;
use glam::DVec3;
use phasmid_geometry::{Cloud, Mesh, MeshTree, Rig, View};
use rayon::prelude::*;

/// Minimum angle of incidence in degrees at which a ray measures nothing.
pub const GRAZING_DEG: f64 = 80.0;

/// Margin at both ends of an occlusion ray, relative to its length, so that the surface from which the
/// ray starts does not block the ray.
const MARGIN: f64 = 1e-7;

/// Returns points evenly distributed over the part of a mesh that the rig's camera sees and its
/// projector lights, both from the same side at less than [`GRAZING_DEG`] of incidence. `samples`
/// points are tried over the whole mesh. Mesh and rig are in the same frame, in millimetres.
pub fn lit_and_seen(mesh: &Mesh, tree: &MeshTree, rig: &Rig, samples: usize) -> Vec<DVec3> {
    let mut ends = Vec::with_capacity(mesh.triangles.len());
    let mut area = 0.0;
    for i in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(i);
        area += (b - a).cross(c - a).length() / 2.0;
        ends.push(area);
    }
    if area <= 0.0 {
        return Vec::new();
    }
    (0..samples)
        .into_par_iter()
        .with_min_len(256)
        .filter_map(|k| {
            // Evenly along the cumulative area, and within a triangle by the R2 sequence (M.
            // Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences", 2018).
            let at = area * (k as f64 + 0.5) / samples as f64;
            let i = ends.partition_point(|&end| end <= at).min(ends.len() - 1);
            let [a, b, c] = mesh.corners(i);
            let normal = (b - a).cross(c - a).try_normalize()?;
            let mut u = (k as f64 * 0.754_877_666_246_692_8).fract();
            let mut v = (k as f64 * 0.569_840_290_998_053_2).fract();
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let p = a + (b - a) * u + (c - a) * v;
            let camera = reach(&rig.camera, p, normal)?;
            let projector = reach(&rig.projector, p, normal)?;
            let clear = |view: &View| {
                let to = view.center();
                !tree.blocks(p, to, MARGIN * (to - p).length())
            };
            (camera * projector > 0.0 && clear(&rig.camera) && clear(&rig.projector)).then_some(p)
        })
        .collect()
}

/// Returns the finite points of a true cloud, all of which are lit and seen.
pub(super) fn all_of(cloud: &Cloud) -> Vec<DVec3> {
    cloud
        .points
        .iter()
        .map(|&p| widened(p))
        .filter(|p| p.is_finite())
        .collect()
}

/// Returns the cosine of the angle of incidence of a view's ray at a point in its field of view,
/// signed by the side of the surface; `None` outside the field of view or at grazing incidence.
fn reach(view: &View, p: DVec3, normal: DVec3) -> Option<f64> {
    let px = view.project(p)?;
    let cosine = (view.center() - p).normalize().dot(normal);
    (view.lens.contains(px) && cosine.abs() > GRAZING_DEG.to_radians().cos()).then_some(cosine)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use glam::DVec2;
    use phasmid_geometry::{Lens, Pose};

    /// A camera at the origin and a projector 400 mm to its right, both 1000 px wide with a half
    /// angle of 45 degrees.
    pub(crate) fn rig() -> Rig {
        let lens = Lens {
            width_px: 1000,
            height_px: 1000,
            focal_px: DVec2::splat(500.0),
            principal_px: DVec2::splat(499.5),
            distortion: [0.0; 5],
        };
        let at = |x| View {
            lens,
            rig_from_view: Pose {
                translation_mm: DVec3::X * x,
                ..Pose::IDENTITY
            },
        };
        Rig {
            camera: at(0.0),
            projector: at(400.0),
            noise: None,
            covariance: None,
        }
    }

    fn quad(corners: [[f64; 3]; 4]) -> Mesh {
        Mesh {
            vertices: corners.map(DVec3::from_array).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        }
    }

    fn square(half: f64, x: f64, z: f64) -> Mesh {
        quad([
            [x - half, -half, z],
            [x + half, -half, z],
            [x + half, half, z],
            [x - half, half, z],
        ])
    }

    #[test]
    fn counts_points_in_both_fields_and_not_in_shadow() {
        // A floor of 4 m side at 1000 mm: the fields of view overlap on 1.6 m by 2 m of it.
        let mut mesh = square(2000.0, 0.0, 1000.0);
        let share = |mesh: &Mesh| {
            let tree = MeshTree::new(mesh);
            lit_and_seen(mesh, &tree, &rig(), 40_000).len() as f64 / 40_000.0
        };
        assert!((share(&mesh) - 0.2).abs() < 0.001, "{}", share(&mesh));
        // A plate of 200 mm side half-way up hides a 400 mm square of floor from each view: x =
        // -200 to 200 from the camera, -600 to -200 from the projector. The plate itself and the
        // rest are seen.
        let plate = square(100.0, 0.0, 500.0);
        mesh.vertices.extend(&plate.vertices);
        mesh.triangles
            .extend(plate.triangles.iter().map(|t| t.map(|i| i + 4)));
        let expected = (3.2e6 - 2.0 * 1.6e5 + 4e4) / (1.6e7 + 4e4);
        assert!((share(&mesh) - expected).abs() < 0.001, "{}", share(&mesh));
    }

    #[test]
    fn grazing_and_opposite_views_do_not_count_as_visible() {
        // A sheet seen edge-on between camera (x = 0) and projector (x = 400): each sees a
        // different side.
        let sheet = quad([
            [200.0, -50.0, 800.0],
            [200.0, -50.0, 900.0],
            [200.0, 50.0, 900.0],
            [200.0, 50.0, 800.0],
        ]);
        assert!(lit_and_seen(&sheet, &MeshTree::new(&sheet), &rig(), 1000).is_empty());
        // Nearly parallel to the camera's rays: 1 in 20 is 87 degrees of incidence.
        let flat = quad([
            [-10.0, 40.0, 800.0],
            [10.0, 40.0, 800.0],
            [10.0, 40.0, 1000.0],
            [-10.0, 40.0, 1000.0],
        ]);
        assert!(lit_and_seen(&flat, &MeshTree::new(&flat), &rig(), 1000).is_empty());
    }
}
