//! Tests that known motions are recovered, and that the motion does not drift along undetermined
//! directions.

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
fn refuses_clouds_with_too_few_matches() {
    let refusal = |points: &[[f32; 3]]| {
        let cloud = Cloud {
            points: points.to_vec(),
            ..Cloud::default()
        };
        align(&cloud, &surface(&floor()), &IcpOptions::default()).map_err(|e| e.to_string())
    };
    let over: Vec<_> = (0..6_u8)
        .map(|i| [30.0 * f32::from(i), 2.0 * f32::from(i * i), 5.0])
        .collect();
    assert_eq!(refusal(&over).unwrap().determined, 3);
    assert_eq!(
        refusal(&over[..5]).unwrap_err(),
        "cloud: too few points match the truth, found 5; expected at least 6, which determine a \
         rigid motion"
    );
    let beside = refusal(&[[900.0, 0.0, 1.0]]).unwrap_err();
    assert!(beside.contains("no part of it lies near"), "{beside}");
    assert!(refusal(&[]).is_err());
}

const NOISE_MM: f64 = 0.1;

/// Deterministic numbers: uniform in [0, 1), and normal with unit variance (sum of 12 uniforms).
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        // Constants of D. Knuth's MMIX generator.
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// A wall of 640 mm with three unequal bumps, up to 15 mm high.
fn bumpy_wall() -> Mesh {
    let n = 64;
    let bump =
        |x: f64, y: f64, mm: f64, width: f64| mm * (-(x * x + 0.5 * y * y) / (width * width)).exp();
    let at = |i: i32, j: i32| {
        let (x, y) = (5.0 * f64::from(i), 5.0 * f64::from(j));
        let z = bump(x - 60.0, y + 30.0, 15.0, 60.0)
            + bump(x + 120.0, y + 90.0, 8.0, 50.0)
            + bump(x + 40.0, y - 140.0, 11.0, 70.0);
        DVec3::new(x, y, -z)
    };
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

/// Aligns a noisy scan of the bumpy wall, of which the fraction `outliers` lies 5 to 50 mm in front.
/// Returns the alignment and the squared error of the motion in standard deviations.
///
/// With inliers p and normals n, least squares has the covariance `sigma^2 (J^T J)^-1`, with rows of
/// J that give the displacement along n. So the sum of `(displacement of p along n)^2 / sigma^2` is
/// `e^T J^T J e / sigma^2` for an error e of the motion: chi-squared with six degrees of freedom.
fn noisy_wall(outliers: f64, seed: u64, truth_is_cloud: bool) -> (Alignment, f64) {
    let mesh = bumpy_wall();
    let moved = motion([4.0, -3.0, 6.0], [0.8, -0.5, 1.0]);
    let mut random = Random(seed);
    let (mut cloud, mut inliers) = (Cloud::default(), Vec::new());
    for i in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(i);
        let (p, normal) = ((a + b + c) / 3.0, (b - a).cross(c - a).normalize());
        if p.truncate().abs().max_element() > 250.0 || random.uniform() > 0.35 {
            continue;
        }
        let noise = DVec3::from_array([(); 3].map(|()| random.normal())) * NOISE_MM;
        let mut at = p + noise;
        if random.uniform() < outliers {
            at.z -= 5.0 + 45.0 * random.uniform();
        } else {
            inliers.push((p, normal));
        }
        cloud.points.push(moved.point(at).as_vec3().to_array());
    }
    let truth = if truth_is_cloud {
        Truth::Cloud(scan(&mesh, &Pose::IDENTITY, |_| true))
    } else {
        Truth::Mesh(mesh)
    };
    let truth = Surface::new(&truth).unwrap();
    let found = align(&cloud, &truth, &IcpOptions::default()).unwrap();
    let round = found.truth_from_cloud * moved;
    let square = inliers
        .iter()
        .map(|&(p, n)| (round.point(p) - p).dot(n).powi(2))
        .sum::<f64>();
    (found, square / NOISE_MM.powi(2))
}

#[test]
fn gross_outliers_do_not_bias_a_noisy_wall() {
    for (outliers, seed) in [(0.0, 1), (0.0, 2), (0.04, 3), (0.04, 4), (0.2, 5), (0.2, 6)] {
        for truth_is_cloud in [false, true] {
            let (found, square) = noisy_wall(outliers, seed, truth_is_cloud);
            assert!(found.converged && found.iterations <= 30, "{found:?}");
            // 20.06 is the 99.73 % quantile of chi-squared with six degrees of freedom; the biweight has
            // an efficiency of 95 %.
            assert!(square < 20.06 / 0.95, "{outliers} {seed}: {square}");
            assert!((found.rejected - outliers).abs() < 0.01, "{found:?}");
            // The outliers raise the median of the residuals by up to 40 %.
            assert!((0.09..0.15).contains(&found.robust_scale_mm), "{found:?}");
        }
    }
}

#[test]
fn a_noisy_plane_with_outliers_does_not_drift() {
    // Two scans of the same pixels, 1 % slope noise: only noise determines the motion in the plane.
    let noise = 0.025;
    let mut random = Random(1);
    let [mut truth, mut cloud] = [Cloud::default(), Cloud::default()];
    for i in 0..130 {
        for j in 0..130 {
            let (x, y) = (2.0 * f64::from(i), 2.0 * f64::from(j));
            let mut at = |z: f64| [x, y, z + noise * random.normal()].map(|v| v as f32);
            truth.points.push(at(0.0));
            cloud.points.push(at(0.0));
            if random.uniform() < 0.04 {
                cloud.points.last_mut().unwrap()[2] -= (5.0 + 45.0 * random.uniform()) as f32;
            }
        }
    }
    let truth = Surface::new(&Truth::Cloud(truth)).unwrap();
    let found = align(&cloud, &truth, &IcpOptions::default()).unwrap();
    let middle = DVec3::new(129.0, 129.0, 0.0);
    let shift = (found.truth_from_cloud.point(middle) - middle).length();
    // The largest singular value is about sqrt(n), the smallest `condition` times less; 3.44
    // standard deviations contain 99.73 % in two dimensions.
    let bound = 3.44 * noise * 2_f64.sqrt() * found.condition / (found.points as f64).sqrt();
    assert!(
        found.converged && shift < bound,
        "{shift} {bound} {found:?}"
    );
}
