//! Registration of a cloud onto a surface: point-to-plane iterative closest points (Y. Chen and
//! G. Medioni, "Object Modelling by Registration of Multiple Range Images", 1992), with outliers
//! left out and directions that the shape does not determine left alone.
//!
//! Each step minimises the sum over points x with foot q and normal n of ((x + w x (x - c) + t - q)
//! . n)^2. With rotations about the centroid c, and lengths in units of the points' spread about it,
//! the six unknowns are of one size, and an eigenvalue of the 6 x 6 system says how well its
//! direction is held: a plane leaves three free, a sphere three, a cylinder two. Those are not moved
//! along.

use super::metrics::finite_points;
use super::surface::{Foot, Surface};
use crate::error::{Error, Result};
use crate::geometry::{Cloud, Pose};
use glam::{DMat3, DVec3};
use nalgebra::{Matrix6, Vector6};
use serde::Serialize;

/// How to register.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IcpOptions {
    /// Steps at most.
    pub max_iterations: usize,
    /// Points used at most, taken evenly along the cloud.
    pub max_points: usize,
    /// Done when a step moves no point by more than this part of the cloud's spread.
    pub tolerance: f64,
    /// Directions whose eigenvalue is below this part of the largest are left alone: 1e-5 is a
    /// slope of 0.3 % RMS.
    pub free_below: f64,
}

impl Default for IcpOptions {
    fn default() -> Self {
        Self {
            max_iterations: 100,
            max_points: 20_000,
            tolerance: 1e-10,
            free_below: 1e-5,
        }
    }
}

/// The motion found, and how far to trust it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Alignment {
    /// Takes the cloud's coordinates to the truth's, in millimetres.
    pub truth_from_cloud: Pose,
    /// Steps made.
    pub iterations: usize,
    /// Whether the last step was below the tolerance.
    pub converged: bool,
    /// How many of the six degrees of freedom the shape determines.
    pub determined: usize,
    /// Largest over smallest singular value of the system in those directions.
    pub condition: f64,
    /// Points that took part in the last step.
    pub points: usize,
    /// RMS distance to the tangent planes of the points that took part in the first step, in mm.
    pub rms_before_mm: f64,
    /// The same of the last step.
    pub rms_after_mm: f64,
}

/// Finds the motion that brings a cloud onto a surface from nearby, both in millimetres.
///
/// # Errors
/// A cloud without a finite point, or one of which nothing faces the surface.
pub fn align(cloud: &Cloud, surface: &Surface, options: &IcpOptions) -> Result<Alignment> {
    let all = finite_points(cloud)?;
    let stride = all.len().div_ceil(options.max_points.max(1));
    let points: Vec<DVec3> = all.iter().copied().step_by(stride).collect();
    let mut pose = Pose::IDENTITY;
    let mut clip = Clip::Wide;
    let mut result: Option<Alignment> = None;
    for iteration in 1..=options.max_iterations {
        let moved: Vec<DVec3> = points.iter().map(|&p| pose.point(p)).collect();
        let pairs = clip.keep(pairs(&moved, &surface.closest_batch(&moved)));
        let Some(step) = Step::solve(&pairs, options.free_below) else {
            break;
        };
        pose = step.motion() * pose;
        // Products of many rotations drift off; this keeps them rotations to rounding.
        pose.rotation = orthonormal(pose.rotation);
        let done = step.size() <= options.tolerance * step.spread;
        result = Some(Alignment {
            truth_from_cloud: pose,
            iterations: iteration,
            converged: done && clip == Clip::Narrow,
            determined: step.determined,
            condition: step.condition,
            points: pairs.len(),
            rms_before_mm: result.map_or(step.rms, |r| r.rms_before_mm),
            rms_after_mm: step.rms,
        });
        match (done, clip) {
            (true, Clip::Narrow) => break,
            // Near the end outliers stand out clearly, so the limit can be tight.
            (true, Clip::Wide) => clip = Clip::Narrow,
            (false, Clip::Wide) if iteration >= options.max_iterations / 2 => clip = Clip::Narrow,
            (false, _) => {}
        }
    }
    result.ok_or_else(|| {
        Error::input(
            "cloud",
            "no part of it lies over the truth",
            "a cloud within a few centimetres of the truth",
        )
    })
}

/// A point, its foot's normal and its distance to the plane there.
#[derive(Clone, Copy)]
struct Pair {
    point: DVec3,
    normal: DVec3,
    residual: f64,
}

fn pairs(points: &[DVec3], feet: &[Option<Foot>]) -> Vec<Pair> {
    points
        .iter()
        .zip(feet)
        .filter_map(|(&point, foot)| {
            let foot = foot.as_ref()?;
            let residual = (point - foot.point).dot(foot.normal);
            // A foot on a border: the point lies beside the surface, not over it.
            let over = residual.abs() >= 0.7 * foot.distance_mm || foot.distance_mm < 1e-9;
            (over && foot.normal != DVec3::ZERO).then_some(Pair {
                point,
                normal: foot.normal,
                residual,
            })
        })
        .collect()
}

/// Which pairs count.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Clip {
    /// Up to four times the RMS of the best 99 %. On the way, most points of a flat scene have no
    /// residual at all, and the few on slopes, which alone tell where to go, must not pass for
    /// outliers.
    Wide,
    /// Up to three standard deviations, these from the median (P. Rousseeuw and A. Leroy, "Robust
    /// Regression and Outlier Detection", 1987).
    Narrow,
}

impl Clip {
    fn keep(self, mut pairs: Vec<Pair>) -> Vec<Pair> {
        let mut sizes: Vec<f64> = pairs.iter().map(|p| p.residual.abs()).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        if sizes.is_empty() {
            return pairs;
        }
        let limit = match self {
            Self::Wide => {
                let best = &sizes[..(sizes.len() * 99).div_ceil(100)];
                4.0 * (best.iter().map(|r| r * r).sum::<f64>() / best.len() as f64).sqrt()
            }
            Self::Narrow => 3.0 * 1.4826 * sizes[sizes.len() / 2],
        };
        // Below a nanometre residuals are rounding, and all of them count.
        let limit = limit.max(1e-6);
        pairs.retain(|p| p.residual.abs() <= limit);
        pairs
    }
}

/// One linear least-squares step.
struct Step {
    centre: DVec3,
    spread: f64,
    /// Rotation vector in radians, then translation in millimetres.
    rotation: DVec3,
    translation: DVec3,
    determined: usize,
    condition: f64,
    rms: f64,
}

impl Step {
    /// `None` without pairs.
    fn solve(pairs: &[Pair], free_below: f64) -> Option<Self> {
        if pairs.is_empty() {
            return None;
        }
        let n = pairs.len() as f64;
        let centre = pairs.iter().map(|p| p.point).sum::<DVec3>() / n;
        let variance = pairs
            .iter()
            .map(|p| (p.point - centre).length_squared())
            .sum::<f64>()
            / n;
        // A single point has no spread; any length will do.
        let spread = if variance > 0.0 { variance.sqrt() } else { 1.0 };
        let (mut system, mut right, mut squares) = (Matrix6::zeros(), Vector6::zeros(), 0.0);
        for pair in pairs {
            let turn = ((pair.point - centre) / spread).cross(pair.normal);
            let [a, b, c] = turn.to_array();
            let [d, e, f] = pair.normal.to_array();
            let row = Vector6::new(a, b, c, d, e, f);
            system += row * row.transpose() / n;
            right -= row * (pair.residual / n);
            squares += pair.residual * pair.residual;
        }
        let eigen = system.symmetric_eigen();
        let largest = eigen.eigenvalues.max();
        let (mut unknowns, mut determined, mut smallest) = (Vector6::zeros(), 0, largest);
        for (value, direction) in eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter())
        {
            if *value > free_below * largest {
                unknowns += direction * (direction.dot(&right) / value);
                determined += 1;
                smallest = smallest.min(*value);
            }
        }
        let u = unknowns;
        Some(Self {
            centre,
            spread,
            rotation: DVec3::new(u[0], u[1], u[2]) / spread,
            translation: DVec3::new(u[3], u[4], u[5]),
            determined,
            condition: (largest / smallest).sqrt(),
            rms: (squares / n).sqrt(),
        })
    }

    /// About how far the step moves points, in millimetres.
    fn size(&self) -> f64 {
        self.rotation.length() * self.spread + self.translation.length()
    }

    fn motion(&self) -> Pose {
        let angle = self.rotation.length();
        let rotation = self
            .rotation
            .try_normalize()
            .map_or(DMat3::IDENTITY, |axis| DMat3::from_axis_angle(axis, angle));
        Pose {
            rotation,
            translation_mm: self.centre + self.translation - rotation * self.centre,
        }
    }
}

/// The nearest rotation for a matrix that is one but for rounding (Gram and Schmidt).
fn orthonormal(m: DMat3) -> DMat3 {
    let x = m.x_axis.normalize();
    let y = (m.y_axis - x * x.dot(m.y_axis)).normalize();
    DMat3::from_cols(x, y, x.cross(y))
}

#[cfg(test)]
mod tests {
    use super::super::surface::Truth;
    use super::*;
    use crate::geometry::Mesh;
    use crate::geometry::shapes::{Torso, torso};

    fn surface(mesh: &Mesh) -> Surface {
        Surface::new(&Truth::Mesh(mesh.clone())).unwrap()
    }

    /// Points inside the triangles of a mesh, moved.
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

    /// How far the found motion leaves points of the truth from where they belong.
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
        // Coordinates are f32: 8e-6 mm of rounding a point, 300 times less over 3000 points each
        // way of six unknowns.
        let at_ends = miss(&found, &moved, &mesh.vertices);
        assert!(at_ends < 2e-6, "{at_ends}");
        // 3 % of gross errors, all to one side, do not shift it.
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
        // 200 mm base, 100 mm top, 80 mm high: its four sides are a tenth of the floor.
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
    fn one_point_and_none() {
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
}
