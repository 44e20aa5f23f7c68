//! Surfaces and scans for tests of the trackers.

use glam::DVec3;
use phasmid_geometry::shapes::{Torso, torso};
use phasmid_geometry::{Mesh, Pose};
use std::f64::consts::TAU;

/// SplitMix64 and the Box-Muller transform.
pub(super) struct Random(u64);

impl Random {
    pub(super) fn new(seed: u64) -> Self {
        // Neighbouring seeds must not give shifted copies of one stream.
        let mut first = Self(seed.wrapping_mul(0xd134_2543_de82_ef95));
        first.uniform();
        Self(first.0 ^ (first.uniform() * 2_f64.powi(53)) as u64)
    }

    pub(super) fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(super) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (TAU * self.uniform()).cos()
    }

    pub(super) fn vector(&mut self) -> DVec3 {
        DVec3::new(self.normal(), self.normal(), self.normal())
    }
}

/// A supine torso in the room frame: head to the gantry, front up, isocentre in the chest.
pub(super) fn patient(triangles: u32) -> Mesh {
    let mut mesh = torso(&Torso {
        seed: 3,
        triangles,
        ..Torso::default()
    });
    for v in &mut mesh.vertices {
        *v = DVec3::new(v.x, -v.y, -v.z) - DVec3::new(0.0, 60.0, 120.0);
    }
    mesh
}

/// The front of [`patient`]: the part that pods on the ceiling see.
pub(super) fn is_front(p: DVec3) -> bool {
    p.z > 20.0 && p.y.abs() < 170.0
}

/// A mesh over the unit square of parameters, `n` cells along u and `m` along v.
pub(super) fn sheet(n: u32, m: u32, at: impl Fn(f64, f64) -> DVec3) -> Mesh {
    let mut mesh = Mesh::default();
    for j in 0..=m {
        for i in 0..=n {
            let (u, v) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(m));
            mesh.vertices.push(at(u, v));
        }
    }
    for j in 0..m {
        for i in 0..n {
            let a = j * (n + 1) + i;
            let (b, c) = (a + 1, a + n + 1);
            mesh.triangles.extend([[a, b, c + 1], [a, c + 1, c]]);
        }
    }
    mesh
}

/// A horizontal square of 400 mm.
pub(super) fn plane() -> Mesh {
    sheet(80, 80, |u, v| {
        DVec3::new(400.0 * u - 200.0, 400.0 * v - 200.0, 30.0)
    })
}

/// The upper part of a sphere of radius 150 mm about (10, 20, -40).
pub(super) fn sphere() -> Mesh {
    sheet(120, 120, |u, v| {
        let (x, y) = (2.0 * (u - 0.5), 2.0 * (v - 0.5));
        DVec3::new(10.0, 20.0, -40.0) + DVec3::new(x, y, 0.9).normalize() * 150.0
    })
}

/// The upper part of a cylinder of radius 120 mm along y.
pub(super) fn cylinder() -> Mesh {
    sheet(100, 100, |u, v| {
        let angle = 2.4 * (0.5 - u);
        DVec3::new(
            -120.0 * angle.sin(),
            400.0 * v - 200.0,
            120.0 * angle.cos() - 100.0,
        )
    })
}

/// The upper half of a torus about the z axis, stretched along x: a circular torus would rotate freely.
pub(super) fn torus() -> Mesh {
    sheet(160, 60, |u, v| {
        let (a, b) = (TAU * u, std::f64::consts::PI * v);
        let ring = 120.0 + 45.0 * b.cos();
        DVec3::new(1.3 * ring * a.cos(), ring * a.sin(), 45.0 * b.sin())
    })
}

/// About `count` points, evenly over the area of the triangles whose centre satisfies `keep`.
pub(super) fn scan(
    mesh: &Mesh,
    count: usize,
    random: &mut Random,
    keep: impl Fn(DVec3) -> bool,
) -> Vec<DVec3> {
    let chosen: Vec<[DVec3; 3]> = (0..mesh.triangles.len())
        .map(|i| mesh.corners(i))
        .filter(|[a, b, c]| keep((*a + *b + *c) / 3.0))
        .collect();
    let area = |t: &[DVec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]).length() / 2.0;
    let total: f64 = chosen.iter().map(area).sum();
    let (mut points, mut reached) = (Vec::with_capacity(count), 0.0);
    for t in &chosen {
        reached += area(t) / total * count as f64;
        while (points.len() as f64) + 0.5 < reached {
            let (mut u, mut v) = (random.uniform(), random.uniform());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            points.push(t[0] + (t[1] - t[0]) * u + (t[2] - t[0]) * v);
        }
    }
    points
}

pub(super) fn moved(points: &[DVec3], pose: &Pose) -> Vec<DVec3> {
    points.iter().map(|&p| pose.point(p)).collect()
}

/// A breathing patient: skin that rises with the chest and, slightly later, with the abdomen, and a
/// tumour below that follows with a lag.
pub(super) struct Breathing {
    pub(super) mesh: Mesh,
    pub(super) tumour: Mesh,
    pub(super) snapshots: super::model::Snapshots,
    lag: f64,
}

/// Creates a patient with this number of skin triangles at the reference phase (end-exhale); the
/// abdomen lags by `lag` rad.
pub(super) fn breathing(triangles: u32, lag: f64) -> Breathing {
    let mut ball = sheet(24, 16, |u, v| {
        let (a, b) = (TAU * u, std::f64::consts::PI * v);
        let r = 12.0 + 2.0 * (3.0 * a).sin() * b.sin().powi(3);
        DVec3::new(60.0, -20.0, 10.0)
            + DVec3::new(b.sin() * a.cos(), b.sin() * a.sin(), -b.cos()) * r
    });
    // Drop the zero-area triangles at the poles.
    ball.triangles.retain(|t| {
        let [a, b, c] = t.map(|i| ball.vertices[i as usize]);
        (b - a).cross(c - a).length() > 1e-9
    });
    let mut case = Breathing {
        mesh: patient(triangles),
        tumour: ball,
        snapshots: super::model::Snapshots::default(),
        lag,
    };
    for k in 0..10 {
        let phase = TAU * f64::from(k) / 10.0;
        let skin = case
            .mesh
            .vertices
            .iter()
            .map(|&v| case.skin_shift(v, phase, 1.0).as_vec3());
        case.snapshots.skin.push(skin.collect());
        let tumour = case
            .tumour
            .vertices
            .iter()
            .map(|_| case.tumour_shift(phase, 1.0).as_vec3());
        case.snapshots.tumour.push(tumour.collect());
    }
    case
}

impl Breathing {
    /// Displacement of the skin at `v`, with `amplitude` times the depth of planning.
    pub(super) fn skin_shift(&self, v: DVec3, phase: f64, amplitude: f64) -> DVec3 {
        let hill = |y: f64, long: f64| (-((v.y - y) / long).powi(2) / 2.0).exp();
        let top = 0.5 * (1.0 + ((v.z - 20.0) / 30.0).tanh());
        let (chest, belly) = (1.0 - phase.cos(), 1.0 - (phase - self.lag).cos());
        let rise = 2.0 * chest * hill(60.0, 80.0) + 4.0 * belly * hill(-90.0, 70.0);
        DVec3::new(0.0, -0.15 * rise, rise) * (amplitude * top)
    }

    /// Displacement of the tumour, which lags behind the abdomen.
    pub(super) fn tumour_shift(&self, phase: f64, amplitude: f64) -> DVec3 {
        let down = 1.0 - (phase - 1.5 * self.lag).cos();
        DVec3::new(0.5, -6.0, 1.5) * (amplitude * down)
    }

    /// The tumour's centroid at a phase of planning.
    pub(super) fn tumour_at(&self, phase: f64) -> DVec3 {
        let (_, centroid) =
            phasmid_measure::solid_moments(&self.tumour.vertices, &self.tumour.triangles);
        centroid + self.tumour_shift(phase, 1.0)
    }

    /// The skin at a phase.
    pub(super) fn skin_at(&self, phase: f64, amplitude: f64) -> Mesh {
        let mut mesh = self.mesh.clone();
        for v in &mut mesh.vertices {
            *v += self.skin_shift(*v, phase, amplitude);
        }
        mesh
    }
}
