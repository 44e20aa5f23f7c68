//! Calibrations that hardly determine a rig, or do not determine it.

use super::case::{Case, Group, Sweep};
use crate::draws::Draws;
use glam::{DMat2, DMat3, DVec2, DVec3};
use phasmid_calibrate::board::{Lit, Sighting};
use phasmid_calibrate::solve::{
    Choice, Coefficients, PoseSightings, Solution, Unsolved, chi_square_bound, solve,
};
use phasmid_core::error::Result;
use phasmid_geometry::{Board, Pose, Rig};
use phasmid_profile::Profile;
use phasmid_report::lab::Context;

/// Standard deviations of camera points and of projector coordinates, in pixels.
const NOISE_PX: [f64; 2] = [0.005, 0.03];
/// Confidence of the bound: one calibration in ten thousand may lie beyond it.
const SURE: f64 = 0.9999;
const BOARD: Board = Board::Chess {
    columns: 9,
    rows: 7,
    pitch_mm: 40.0,
};
const CHOICE: Choice = Choice {
    camera: Coefficients::Fixed([false; 5]),
    projector: Coefficients::Fixed([false; 5]),
    robust: true,
};

pub(super) const GROUP: Group = Group {
    title: "Calibrations",
    sweeps: &[
        Sweep {
            key: "tilts",
            title: "Six boards, tilted less and less against each other",
            oracle: "Points of a known rig, seen with noise of 0.005 px (camera) and 0.03 px \
                (projector). Error: squared Mahalanobis distance of lenses, rig and poses from the \
                truth. Allowed: the 99.99 % quantile of chi-square. Where the tilts determine too \
                little, the solver refuses",
            ratio: "1 / tilt in rad",
            error: "Mahalanobis distance squared",
            rounding: false,
            cases: tilts,
        },
        Sweep {
            key: "noise-of-boards",
            title: "Noise of the points from a billionth of a pixel to half a pixel, tilts of 30 \
                degrees",
            oracle: "As before. The covariance is of first order in the noise; a board's squares \
                are 25 pixels wide, and beyond half a pixel the second-order terms become visible",
            ratio: "image width over noise",
            error: "Mahalanobis distance squared",
            rounding: false,
            cases: noises,
        },
        Sweep {
            key: "boards-degenerate",
            title: "Boards that determine no rig",
            oracle: "There is no answer; the solver's message is quoted",
            ratio: "poses",
            error: "-",
            rounding: false,
            cases: degenerate,
        },
    ],
};

struct Bench {
    rig: Rig,
    noise: [f64; 2],
    draws: Draws,
}

impl Bench {
    fn new(context: &Context<'_>, stream: u32) -> Result<Self> {
        let mut rig = Profile::load("pmp-bench")?.nominal_rig();
        rig.noise = None;
        Ok(Self {
            rig,
            noise: NOISE_PX,
            draws: Draws::new(context.seed, 1000 + stream),
        })
    }

    /// Returns the projector pixel that lights the board point seen by a camera pixel.
    fn lit(&self, px: DVec2, pose: &Pose) -> DVec2 {
        let ray = self.rig.camera.lens.ray(px);
        let normal = pose.rotation.z_axis;
        let point = ray * (normal.dot(pose.translation_mm) / normal.dot(ray));
        let place = self.rig.projector.rig_from_view.inverse().point(point);
        self.rig.projector.lens.project(place).unwrap_or(DVec2::NAN)
    }

    fn sightings(&self, poses: &[Pose]) -> Vec<PoseSightings> {
        let of = |(i, pose): (usize, &Pose)| PoseSightings {
            name: format!("pose_{i:02}"),
            sightings: BOARD
                .indices()
                .filter_map(|index| self.sighting(i, index, pose))
                .collect(),
        };
        poses.iter().enumerate().map(of).collect()
    }

    fn sighting(&self, i: usize, index: [u32; 2], pose: &Pose) -> Option<Sighting> {
        let camera = &self.rig.camera.lens;
        let exact = camera.project(pose.point(BOARD.point(index).extend(0.0)))?;
        let counter = (i as u64) << 32 | u64::from(index[0]) << 16 | u64::from(index[1]) << 4;
        let [own, decoder] = self.noise;
        let seen = exact + own * self.draws.normals(counter);
        let step = 1e-3;
        let at = |px: DVec2| self.lit(px, pose);
        let slope = DMat2::from_cols(
            (at(seen + DVec2::X * step) - at(seen - DVec2::X * step)) / (2.0 * step),
            (at(seen + DVec2::Y * step) - at(seen - DVec2::Y * step)) / (2.0 * step),
        );
        let px = at(seen) + decoder * self.draws.normals(counter | 1);
        let lit = Lit {
            px,
            slope,
            covariance: DMat2::from_diagonal(DVec2::splat(decoder * decoder)),
        };
        camera.contains(exact).then(|| Sighting {
            index,
            camera_px: seen,
            camera_covariance: DMat2::from_diagonal(DVec2::splat(own * own)),
            projector: (px.is_finite() && self.rig.projector.lens.contains(px)).then_some(lit),
        })
    }

    fn solve(&self, sightings: &[PoseSightings]) -> std::result::Result<Solution, Unsolved> {
        let [camera, projector] = [self.rig.camera, self.rig.projector]
            .map(|view| [view.lens.width_px, view.lens.height_px]);
        solve(&BOARD, sightings, camera, projector, &CHOICE)
    }

    /// Solves a calibration and returns its case: the rig must be accurate, or the solver must refuse
    /// the calibration as badly determined.
    fn judged(&self, name: String, ratio: f64, poses: &[Pose]) -> Case {
        match self.solve(&self.sightings(poses)) {
            Ok(found) => {
                let (square, freedom) = found.mahalanobis(&self.rig, Some(poses));
                let condition = format!("condition number {:.0e}", found.condition);
                let warned = found.warnings.first();
                let says =
                    warned.map_or(condition.clone(), |w| format!("{condition}; warning: {w}"));
                Case::held(name, ratio, square, chi_square_bound(SURE, freedom)).says(says)
            }
            Err(refusal) => Case::refused(name, ratio, &refusal.to_string(), "expected"),
        }
    }
}

/// Returns six boards about 1000 mm away, tilted by `tilt_deg` about axes in all directions.
fn tilted(tilt_deg: f64) -> Vec<Pose> {
    (0..6)
        .map(|i| {
            let azimuth = 2.399_963 * f64::from(i);
            let axis = DVec3::new(azimuth.cos(), azimuth.sin(), 0.0);
            Pose {
                rotation: DMat3::from_axis_angle(axis, tilt_deg.to_radians()),
                translation_mm: DVec3::new(
                    40.0 * f64::from(i) - 100.0,
                    15.0 * f64::from(i % 3) - 15.0,
                    900.0 + 45.0 * f64::from(i),
                ),
            }
        })
        .collect()
}

fn tilts(context: &Context<'_>) -> Result<Vec<Case>> {
    let tilts = [40.0, 20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.01, 0.0];
    let one = |(i, tilt): (usize, f64)| {
        let bench = Bench::new(context, i as u32)?;
        let ratio = 1.0 / f64::to_radians(tilt);
        Ok(bench.judged(format!("{tilt} degrees"), ratio, &tilted(tilt)))
    };
    tilts.into_iter().enumerate().map(one).collect()
}

fn noises(context: &Context<'_>) -> Result<Vec<Case>> {
    let one = |(i, noise): (usize, f64)| {
        let mut bench = Bench::new(context, 20 + i as u32)?;
        bench.noise = [noise; 2];
        let width = f64::from(bench.rig.camera.lens.width_px);
        Ok(bench.judged(format!("{noise:e} px"), width / noise, &tilted(30.0)))
    };
    [1e-9, 1e-6, 1e-3, 0.03, 0.3, 0.5]
        .into_iter()
        .enumerate()
        .map(one)
        .collect()
}

fn degenerate(context: &Context<'_>) -> Result<Vec<Case>> {
    let bench = Bench::new(context, 40)?;
    let whole = tilted(30.0);
    let refused = |name: &str, sightings: &[PoseSightings], words: &str| {
        let says = bench
            .solve(sightings)
            .map_or_else(|e| e.to_string(), |_| String::new());
        Case::refused(name, sightings.len() as f64, &says, words)
    };
    let shifted: Vec<Pose> = (0..6)
        .map(|i| Pose::from_xyz_deg(DVec3::new(20.0 * f64::from(i), 0.0, 1000.0), DVec3::ZERO))
        .collect();
    let deeper: Vec<Pose> = (0..6)
        .map(|i| {
            let place = DVec3::new(10.0 * f64::from(i), 0.0, 900.0 + 40.0 * f64::from(i));
            Pose::from_xyz_deg(place, DVec3::new(0.0, 30.0, 0.0))
        })
        .collect();
    let mut mirrored = bench.sightings(&whole);
    for s in mirrored.iter_mut().flat_map(|p| &mut p.sightings) {
        s.camera_px.x = f64::from(bench.rig.camera.lens.width_px) - 1.0 - s.camera_px.x;
    }
    let mut dark = bench.sightings(&whole);
    for s in dark.iter_mut().flat_map(|p| &mut p.sightings) {
        s.projector = None;
    }
    let mut point = bench.sightings(&whole);
    for s in point.iter_mut().flat_map(|p| &mut p.sightings) {
        s.camera_px = DVec2::new(500.0, 200.0);
    }
    let mut line = bench.sightings(&whole);
    for pose in &mut line {
        pose.sightings.retain(|s| s.index[1] == 3);
    }
    Ok(vec![
        refused("no pose", &[], "too few poses"),
        refused("one pose", &bench.sightings(&whole[..1]), "too few poses"),
        refused(
            "six times the same pose",
            &bench.sightings(&[whole[0]; 6]),
            "face the same way",
        ),
        refused(
            "six places in one plane",
            &bench.sightings(&shifted),
            "face the same way",
        ),
        refused(
            "six parallel planes",
            &bench.sightings(&deeper),
            "face the same way",
        ),
        refused("mirrored pictures", &mirrored, "mirrored"),
        refused("boards in the dark", &dark, "too few points"),
        refused("all points at one place", &point, "expected"),
        refused("one line of points", &line, "expected"),
        refused("501 poses", &vec![point[0].clone(); 501], "too many poses"),
    ])
}
