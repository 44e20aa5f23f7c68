//! Simulated observations, computed independently of the solver's model: the projector coordinate
//! belongs to the board point that the observed (noisy) camera pixel sees.

use super::super::PoseSightings;
use crate::board::{Lit, Sighting};
use glam::{DMat2, DVec2, DVec3};
use phasmid_geometry::{Board, Lens, Pose, Rig, nominal};

/// Uniform and normal random numbers (Knuth's 64-bit congruential generator; Box and Muller 1958).
pub struct Draws(u64);

impl Draws {
    pub fn new(seed: u64) -> Self {
        let mut draws = Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(seed));
        for _ in 0..8 {
            draws.even();
        }
        draws
    }

    pub fn even(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    pub fn normal(&mut self) -> f64 {
        (-2.0 * self.even().ln()).sqrt() * (std::f64::consts::TAU * self.even()).cos()
    }

    fn normals(&mut self) -> DVec2 {
        DVec2::new(self.normal(), self.normal())
    }
}

/// A rig and the board poses it observes.
#[derive(Clone)]
pub struct Scene {
    pub board: Board,
    pub rig: Rig,
    /// `camera_from_board`.
    pub boards: Vec<Pose>,
    /// Typical standard deviations of camera points and projector coordinates in pixels.
    pub noise: [f64; 2],
}

pub fn rig(profile: &str) -> Rig {
    let mut rig = nominal::rig(profile);
    rig.noise = None;
    rig
}

/// Boards tilted by 15 to 45 degrees about axes in all directions, within the fields of both
/// lenses.
pub fn poses(count: usize, distance: f64, seed: u64) -> Vec<Pose> {
    let mut draws = Draws::new(seed);
    (0..count)
        .map(|i| {
            let azimuth = 2.399_963 * i as f64;
            let tilt = (15.0 + 30.0 * draws.even()).to_radians();
            let axis = DVec3::new(azimuth.cos(), azimuth.sin(), 0.0);
            let roll = glam::DMat3::from_rotation_z((draws.even() - 0.5) * 1.0);
            let z = distance * (0.85 + 0.3 * draws.even());
            Pose {
                rotation: glam::DMat3::from_axis_angle(axis, tilt) * roll,
                translation_mm: DVec3::new(
                    distance * 0.5 * (draws.even() - 0.5),
                    distance * 0.2 * (draws.even() - 0.5),
                    z,
                ),
            }
        })
        .collect()
}

impl Scene {
    pub fn bench(count: usize, seed: u64) -> Self {
        Self {
            board: Board::DOTS.scaled(4.0),
            rig: rig("pmp-bench"),
            boards: poses(count, 1000.0, seed),
            noise: [0.005, 0.03],
        }
    }

    pub fn sizes(&self) -> [[u32; 2]; 2] {
        let size = |l: &Lens| [l.width_px, l.height_px];
        [size(&self.rig.camera.lens), size(&self.rig.projector.lens)]
    }

    /// Simulates the observations, with noise from a seed or exact.
    pub fn sightings(&self, seed: Option<u64>) -> Vec<PoseSightings> {
        let mut draws = Draws::new(seed.unwrap_or(0));
        let noisy = f64::from(u8::from(seed.is_some()));
        self.boards
            .iter()
            .enumerate()
            .map(|(i, pose)| PoseSightings {
                name: format!("pose_{i:02}"),
                sightings: self
                    .board
                    .indices()
                    .filter_map(|index| self.sighting(index, pose, &mut draws, noisy))
                    .collect(),
            })
            .collect()
    }

    fn sighting(
        &self,
        index: [u32; 2],
        pose: &Pose,
        draws: &mut Draws,
        noisy: f64,
    ) -> Option<Sighting> {
        let camera = &self.rig.camera.lens;
        let point = self.board.point(index);
        let exact = camera.project(pose.point(point.extend(0.0)))?;
        // Every covariance is different, with a ratio of the axes of up to five.
        let mut factor = |sigma: f64| {
            let turn = DMat2::from_angle(draws.even() * 3.2);
            let long = sigma * (0.4 + 1.6 * draws.even());
            turn * DMat2::from_diagonal(DVec2::new(long, sigma * (0.4 + 0.6 * draws.even())))
        };
        let (own, decoder) = (factor(self.noise[0]), factor(self.noise[1]));
        let seen = exact + own * draws.normals() * noisy;
        let step = 1e-3;
        let at = |px: DVec2| self.lit(px, pose);
        let slope = DMat2::from_cols(
            (at(seen + DVec2::X * step) - at(seen - DVec2::X * step)) / (2.0 * step),
            (at(seen + DVec2::Y * step) - at(seen - DVec2::Y * step)) / (2.0 * step),
        );
        let px = at(seen) + decoder * draws.normals() * noisy;
        let lit = Lit {
            px,
            slope,
            covariance: decoder * decoder.transpose(),
        };
        camera.contains(exact).then(|| Sighting {
            index,
            camera_px: seen,
            camera_covariance: own * own.transpose(),
            projector: (px.is_finite() && self.rig.projector.lens.contains(px)).then_some(lit),
        })
    }

    /// Projector pixel that illuminates the board point seen by a camera pixel.
    fn lit(&self, px: DVec2, pose: &Pose) -> DVec2 {
        let ray = self.rig.camera.lens.ray(px);
        let normal = pose.rotation.z_axis;
        let point = ray * (normal.dot(pose.translation_mm) / normal.dot(ray));
        let place = self.rig.projector.rig_from_view.inverse().point(point);
        self.rig.projector.lens.project(place).unwrap_or(DVec2::NAN)
    }
}
