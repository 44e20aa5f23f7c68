//! Test helper that creates synthetic decoded maps, with ground truth, from a rig and a board's
//! pose.

use super::super::Seen;
use super::super::bias::image;
use super::{LocalFit, Unread, local_fits};
use glam::{DMat2, DVec2, DVec3};
use phasmid_decode::{AxisMap, Decoded, Verdict};
use phasmid_geometry::{Board, Lens, Pose, Rig, View};

/// Pseudo-random numbers: uniform in [0, 1) by SplitMix64, normal by Box-Muller.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(crate) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

const PAPER: f64 = 0.025;
const INK: f64 = 0.12;

/// Returns a rig for a board 1000 mm away: a camera with this focal length and image size, and a
/// projector, both with lens distortion.
pub(crate) fn rig(focal_px: f64, [width_px, height_px]: [u32; 2]) -> Rig {
    let camera = Lens {
        width_px,
        height_px,
        focal_px: DVec2::splat(focal_px),
        principal_px: DVec2::new(f64::from(width_px), f64::from(height_px)) / 2.0 - 0.5,
        distortion: [-0.12, 0.08, 6e-4, -4e-4, 0.0],
    };
    let projector = Lens {
        width_px: 1920,
        height_px: 1080,
        focal_px: DVec2::splat(2751.4),
        principal_px: DVec2::new(2060.0, 539.5),
        distortion: [0.03, -0.02, 0.0, 4e-4, 0.0],
    };
    let view = |lens, x| View {
        lens,
        rig_from_view: Pose::from_xyz_deg(DVec3::new(x, 0.0, 0.0), DVec3::ZERO),
    };
    Rig {
        camera: view(camera, 0.0),
        projector: view(projector, 400.0),
        noise: None,
        covariance: None,
    }
}

/// A board in front of a rig, and the points that the camera sees.
pub(crate) struct Case {
    pub(crate) rig: Rig,
    pub(crate) pose: Pose,
    pub(crate) board: Board,
    pub(crate) seen: Vec<Seen>,
}

impl Case {
    pub(crate) fn new(rig: Rig, pose: Pose, board: Board) -> Self {
        let lens = &rig.camera.lens;
        let size = DVec2::new(lens.width_px.into(), lens.height_px.into());
        let seen = board
            .indices()
            .filter_map(|index| {
                let (px, slope) = image(lens, &pose, board.point(index))?;
                let inside = px.cmpge(DVec2::splat(8.0)).all() && px.cmple(size - 9.0).all();
                inside.then_some(Seen {
                    index,
                    px,
                    covariance: DMat2::IDENTITY * 1e-5,
                    outline: slope * board.radius_mm(index),
                })
            })
            .collect();
        Self {
            rig,
            pose,
            board,
            seen,
        }
    }

    /// Intersection of a camera pixel's ray with the board, in millimetres in the board's frame.
    pub(crate) fn on_board(&self, px: DVec2) -> DVec3 {
        let board_from_camera = self.pose.inverse();
        let (origin, ray) = (
            board_from_camera.translation_mm,
            board_from_camera.direction(self.rig.camera.ray(px)),
        );
        origin - ray * (origin.z / ray.z)
    }

    /// True projector coordinates at a camera pixel.
    pub(crate) fn truth(&self, px: DVec2) -> DVec2 {
        let p = self.pose.point(self.on_board(px));
        self.rig.projector.project(p).unwrap_or(DVec2::NAN)
    }

    /// Whether the projector lights the surroundings of a camera pixel on all sides.
    pub(crate) fn is_lit(&self, px: DVec2) -> bool {
        let lens = &self.rig.projector.lens;
        [-8.0, 8.0].iter().all(|&u| {
            [-8.0, 8.0]
                .iter()
                .all(|&v| lens.contains(self.truth(px + DVec2::new(u, v))))
        })
    }

    /// Approximate distance in camera pixels from the outline of the nearest dot, negative inside.
    pub(crate) fn past_outline(&self, px: DVec2) -> f64 {
        let mm = self.on_board(px).truncate();
        let [columns, rows] = self.board.grid();
        let last = DVec2::new(f64::from(columns), f64::from(rows)) - 1.0;
        let at = (mm / self.board.pitch_mm() + last / 2.0).round();
        let at = at.clamp(DVec2::ZERO, last);
        let index = [at.x as u32, at.y as u32];
        ((mm - self.board.point(index)).length() - self.board.radius_mm(index))
            * (self.rig.camera.lens.focal_px.x / 1000.0)
    }

    /// Decoded maps with white noise; `spoil` may change a pixel's coordinates.
    pub(crate) fn decoded(
        &self,
        noise: f64,
        seed: u64,
        spoil: impl Fn(DVec2, &mut [f64; 2]),
    ) -> Decoded {
        let mut random = Random(seed);
        let lens = &self.rig.camera.lens;
        let (width, height) = (lens.width_px as usize, lens.height_px as usize);
        let n = width * height;
        let map = || AxisMap {
            coordinate: vec![f32::NAN; n],
            sigma: vec![f32::NAN; n],
            verdict: vec![Verdict::Dim; n],
            ..AxisMap::default()
        };
        let mut maps = [map(), map()];
        let chess = matches!(self.board, Board::Chess { .. });
        for i in 0..n {
            let px = DVec2::new((i % width) as f64, (i / width) as f64);
            let truth = self.truth(px);
            if !self.rig.projector.lens.contains(truth) {
                continue;
            }
            let ink = !chess && self.past_outline(px) < 0.0;
            let sigma = if ink { INK } else { PAPER };
            let mut values = truth
                .to_array()
                .map(|v| v + noise * sigma * random.normal());
            spoil(px, &mut values);
            for (map, value) in maps.iter_mut().zip(values) {
                map.coordinate[i] = value as f32;
                map.sigma[i] = sigma as f32;
                map.verdict[i] = Verdict::Valid;
            }
        }
        let [x, y] = maps;
        Decoded {
            width,
            height,
            x: Some(x),
            y: Some(y),
            ..Decoded::default()
        }
    }

    /// Errors of the fits in pixels, and the same errors divided by their standard deviations.
    pub(crate) fn errors(&self, decoded: &Decoded) -> Vec<Option<(DVec2, DVec2)>> {
        let fits = local_fits(&self.board, &self.seen, decoded);
        assert_eq!(fits.len(), self.seen.len());
        let error = |(seen, fit): (&Seen, &Result<LocalFit, Unread>)| {
            let lit = fit.as_ref().ok()?.at(seen.px);
            let off = lit.px - self.truth(seen.px);
            let sigma = DVec2::new(
                lit.covariance.x_axis.x.sqrt(),
                lit.covariance.y_axis.y.sqrt(),
            );
            Some((off, off / sigma))
        };
        self.seen.iter().zip(&fits).map(error).collect()
    }
}
