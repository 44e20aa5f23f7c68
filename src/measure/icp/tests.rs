//! Known motions are recovered, and undetermined directions do not drift.

use super::*;
use crate::surface::Truth;
use phasmid_geometry::Mesh;
use phasmid_geometry::shapes::{Torso, torso};

fn surface(mesh: &Mesh) -> Surface {
    Surface::new(&Truth::Mesh(mesh.clone())).unwrap()
}

/// Points inside the triangles of a mesh, transformed by `cloud_from_truth`.
fn scan(mesh: &Mesh, cloud_from_truth: &Pose, keep: impl Fn(DVec3) -> bool) -> Cloud {
    let points = (0..mesh.triangles.len())
        .map(|i| {
            let [a, b, c] = mesh.corners(i);
            let (u, v) = (0.2 + 0.1 * (i % 3) as f64, 0.3);
            a * u + b * v + c * (1.0 - u - v)
        })
        .filter(|&p| keep(p))
        .map(|p| cloud_from_truth.point(p).as_vec3().to_array())
        .collect();
    Cloud {
        points,
        ..Cloud::default()
    }
}

fn motion(shift: [f64; 3], turn: [f64; 3]) -> Pose {
    Pose::from_xyz_deg(DVec3::from_array(shift), DVec3::from_array(turn))
}

/// Largest distance by which the found motion misplaces points of the truth.
fn miss(found: &Alignment, cloud_from_truth: &Pose, points: &[DVec3]) -> f64 {
    let round = found.truth_from_cloud * *cloud_from_truth;
    points
        .iter()
        .map(|&p| (round.point(p) - p).length())
        .fold(0.0, f64::max)
}

#[test]
fn recovers_a_motion_of_a_torso() {
    let mesh = torso(&Torso {
        triangles: 8000,
        ..Torso::default()
    });
    let truth = surface(&mesh);
    let front = |p: DVec3| p.z < -60.0 && p.y.abs() < 230.0;
    let moved = motion([4.0, -3.0, 6.0], [1.5, -1.0, 2.0]);
    let mut cloud = scan(&mesh, &moved, front);
    let found = align(&cloud, &truth, &IcpOptions::default()).unwrap();
    assert!(found.converged, "{found:?}");
    assert_eq!(found.determined, 6);
    assert!(
        found.condition < 50.0 && found.rms_after_mm < 1e-4,
        "{found:?}"
    );
    assert!(found.rms_before_mm > 1.0);
    // Coordinates are f32: each is rounded by up to 8e-6 mm, and the fit averages over all points.
    let at_ends = miss(&found, &moved, &mesh.vertices);
    assert!(at_ends < 2e-6, "{at_ends}");
    // 3 % of gross errors, all to one side, do not bias the result.
    for i in (0..cloud.points.len()).step_by(33) {
        cloud.points[i][2] -= 25.0;
    }
    let found = align(&cloud, &truth, &IcpOptions::default()).unwrap();
    assert!(found.converged, "{found:?}");
    let at_ends = miss(&found, &moved, &mesh.vertices);
    assert!(at_ends < 2e-6, "{at_ends}");
}

fn floor() -> Mesh {
    let n = 30;
    let at = |i: i32, j: i32| DVec3::new(f64::from(i) * 20.0, f64::from(j) * 20.0, 0.0);
    let mut mesh = Mesh::default();
    for i in -n..n {
        for j in -n..n {
            let k = mesh.vertices.len() as u32;
            mesh.vertices
                .extend([at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]);
            mesh.triangles
                .extend([[k, k + 1, k + 2], [k, k + 2, k + 3]]);
        }
    }
    mesh
}

#[test]
fn a_frustum_on_a_floor_is_found_by_its_sides() {
    // 200 mm base, 100 mm top, 80 mm high: its four sides have a tenth of the floor's area.
    let mut mesh = floor();
    let ring = |half: f64, z: f64| {
        [(-half, -half), (-half, half), (half, half), (half, -half)]
            .map(|(x, y)| DVec3::new(x, y, z))
    };
    let steps = 20_u32;
    let base = mesh.vertices.len() as u32;
    for k in 0..=steps {
        let t = f64::from(k) / f64::from(steps);
        mesh.vertices.extend(ring(100.0 - 50.0 * t, -80.0 * t));
    }
    for k in 0..steps {
        for side in 0..4 {
            let (a, b) = (base + 4 * k + side, base + 4 * k + (side + 1) % 4);
            for _ in 0..6 {
                mesh.triangles.extend([[a, b, b + 4], [a, b + 4, a + 4]]);
            }
        }
    }
    let moved = motion([6.0, -5.0, 2.0], [0.3, -0.2, 1.0]);
    let cloud = scan(&mesh, &moved, |p| {
        p.z < 0.0 || p.truncate().abs().max_element() > 110.0
    });
    let found = align(&cloud, &surface(&mesh), &IcpOptions::default()).unwrap();
    assert!(found.converged && found.determined == 6, "{found:?}");
    let at_ends = miss(&found, &moved, &mesh.vertices);
    assert!(at_ends < 1e-5, "{at_ends}");
}

#[test]
fn a_plane_holds_three_degrees_and_does_not_drift() {
    let mesh = floor();
    let moved = motion([0.0, 0.0, 3.0], [0.4, -0.3, 0.0]);
    let mut cloud = scan(&mesh, &moved, |p| p.truncate().abs().max_element() < 400.0);
    for (i, p) in cloud.points.iter_mut().enumerate() {
        // Noise of +-50 um.
        p[2] += 0.1 * ((i as f32 * 0.618_034).fract() - 0.5);
    }
    let found = align(&cloud, &surface(&mesh), &IcpOptions::default()).unwrap();
    assert_eq!(found.determined, 3);
    assert!(found.converged && found.rms_after_mm < 0.03, "{found:?}");
    let back = found.truth_from_cloud * moved;
    // The tilt alone moves points sideways by 3 mm times half a degree, never along the plane.
    let shift = back.point(DVec3::ZERO);
    assert!(
        shift.truncate().length() < 0.05 && shift.z.abs() < 0.01,
        "{shift}"
    );
    let spin = back.rotation.x_axis.y;
    assert!(spin.abs() < 1e-4, "{spin}");
}

#[test]
fn aligns_one_point_and_refuses_clouds_without_matches() {
    let one = Cloud {
        points: vec![[1.0, 2.0, 5.0]],
        ..Cloud::default()
    };
    let found = align(&one, &surface(&floor()), &IcpOptions::default()).unwrap();
    assert_eq!(found.determined, 1);
    let at = found.truth_from_cloud.point(DVec3::new(1.0, 2.0, 5.0));
    assert!((at - DVec3::new(1.0, 2.0, 0.0)).length() < 1e-9, "{at}");
    let beside = Cloud {
        points: vec![[900.0, 0.0, 1.0]],
        ..Cloud::default()
    };
    assert!(align(&beside, &surface(&floor()), &IcpOptions::default()).is_err());
    let none = Cloud::default();
    assert!(align(&none, &surface(&floor()), &IcpOptions::default()).is_err());
}
