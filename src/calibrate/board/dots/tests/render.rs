//! Renders boards by a method independent of the model: projects each dot's outline point by point
//! through pose and lens, clips the polygon to subpixels a quarter of a pixel wide (an eighth under
//! slight blur), multiplies by the light, and blurs the fine image with sampled weights before
//! binning it.

use crate::board::BoardImage;
use glam::{DMat3, DVec2, DVec3};
use phasmid_geometry::{Board, Lens, Pose};
use std::collections::BTreeMap;

/// Points per outline.
const POINTS: usize = 360;

pub struct Scene {
    pub board: Board,
    pub lens: Lens,
    pub pose: Pose,
    /// Paper level at a pixel position.
    pub light: fn(DVec2) -> f64,
    /// Standard deviation of the blur in pixels.
    pub blur: f64,
    /// Noise scale: 1 gives 0.25 DN on paper of 188 DN; 0 disables noise.
    pub noise: f64,
    pub seed: u64,
    /// Dots that are not drawn.
    pub hidden: Vec<[u32; 2]>,
}

/// Lens of the project's bench: 1138 x 489 pixels, focal length 632 pixels.
pub fn bench_lens() -> Lens {
    Lens {
        width_px: 1138,
        height_px: 489,
        focal_px: DVec2::splat(632.2),
        principal_px: DVec2::new(568.5, 244.0),
        distortion: [0.0; 5],
    }
}

/// The same lens with a smaller image around the centre.
pub fn small_lens(width: u32, height: u32) -> Lens {
    Lens {
        width_px: width,
        height_px: height,
        principal_px: DVec2::new(f64::from(width - 1), f64::from(height - 1)) / 2.0,
        ..bench_lens()
    }
}

/// Pose of a board at a position, turned in its plane, then tilted about an axis in the image
/// plane.
pub fn pose(at: DVec3, turn_deg: f64, tilt_deg: f64, axis_deg: f64) -> Pose {
    let axis = axis_deg.to_radians();
    let tilt = DMat3::from_axis_angle(
        DVec3::new(axis.cos(), axis.sin(), 0.0),
        tilt_deg.to_radians(),
    );
    Pose {
        rotation: tilt * DMat3::from_rotation_z(turn_deg.to_radians()),
        translation_mm: at,
    }
}

/// A board with the dimensions of the bench's dots but fewer of them.
pub fn board(columns: u32, rows: u32) -> Board {
    Board::Dots {
        columns,
        rows,
        pitch_mm: 24.0,
        dot_mm: 10.0,
        marker_mm: 20.0,
    }
}

impl Scene {
    pub fn new(board: Board, lens: Lens, pose: Pose) -> Self {
        Self {
            board,
            lens,
            pose,
            light: |_| 188.0,
            blur: 0.0,
            noise: 1.0,
            seed: 1,
            hidden: Vec::new(),
        }
    }

    /// Number of subpixels along a pixel's side: more under slight blur, so that the blur spans several.
    fn fine(&self) -> usize {
        if self.blur > 0.0 && self.blur < 0.5 {
            8
        } else {
            4
        }
    }

    fn outline(&self, index: [u32; 2]) -> Option<Vec<DVec2>> {
        let (middle, radius) = (self.board.point(index), self.board.radius_mm(index));
        (0..POINTS)
            .map(|k| {
                let t = k as f64 * std::f64::consts::TAU / POINTS as f64;
                let at = middle + radius * DVec2::new(t.cos(), t.sin());
                self.lens.project(self.pose.point(at.extend(0.0)))
            })
            .collect()
    }

    /// Centroid of each dot whose outline is at least `margin` pixels inside the image.
    pub fn truth(&self, margin: f64) -> BTreeMap<[u32; 2], DVec2> {
        let (w, h) = (
            f64::from(self.lens.width_px),
            f64::from(self.lens.height_px),
        );
        self.board
            .indices()
            .filter(|index| !self.hidden.contains(index))
            .filter_map(|index| {
                let outline = self.outline(index)?;
                let inside = outline.iter().all(|p| {
                    p.x - margin >= -0.5
                        && p.y - margin >= -0.5
                        && p.x + margin <= w - 0.5
                        && p.y + margin <= h - 0.5
                });
                inside.then(|| (index, area_and_centroid(&outline).1))
            })
            .collect()
    }

    /// Fraction of each subpixel covered by ink.
    fn ink(&self) -> Vec<f64> {
        let (width, height) = (
            self.lens.width_px as usize * self.fine(),
            self.lens.height_px as usize * self.fine(),
        );
        let mut ink = vec![0.0; width * height];
        for index in self.board.indices().filter(|i| !self.hidden.contains(i)) {
            let Some(outline) = self.outline(index) else {
                continue;
            };
            // Subpixel k covers [k, k + 1) in these coordinates.
            let fine: Vec<DVec2> = outline
                .iter()
                .map(|p| (p + 0.5) * self.fine() as f64)
                .collect();
            let low = fine.iter().fold(DVec2::INFINITY, |a, p| a.min(*p)).floor();
            let high = fine
                .iter()
                .fold(DVec2::NEG_INFINITY, |a, p| a.max(*p))
                .ceil();
            if !(low.is_finite() && high.is_finite()) || (high - low).max_element() > 2000.0 {
                continue;
            }
            let rows = (low.y.max(0.0) as usize)..(high.y.clamp(0.0, height as f64) as usize);
            for v in rows {
                let y = v as f64;
                let strip = cut(&cut(&fine, |p| p.y - y), |p| y + 1.0 - p.y);
                if strip.is_empty() {
                    continue;
                }
                let columns = (low.x.max(0.0) as usize)..(high.x.clamp(0.0, width as f64) as usize);
                for u in columns {
                    let x = u as f64;
                    let cell = cut(&cut(&strip, |p| p.x - x), |p| x + 1.0 - p.x);
                    ink[v * width + u] += area_and_centroid(&cell).0;
                }
            }
        }
        ink
    }

    /// Noise-free level of each pixel.
    fn clean(&self) -> Vec<f64> {
        let (width, height) = (self.lens.width_px as usize, self.lens.height_px as usize);
        let mut fine = self.ink();
        let sheet = self.sheet();
        let fine_width = width * self.fine();
        for (k, value) in fine.iter_mut().enumerate() {
            let (u, v) = (k % fine_width, k / fine_width);
            let px = (DVec2::new(u as f64, v as f64) + 0.5) / self.fine() as f64 - 0.5;
            let paper = if sheet[v / self.fine() * width + u / self.fine()] {
                1.0
            } else {
                0.01
            };
            *value = (self.light)(px) * paper * (1.0 - 0.94 * *value);
        }
        blur(&mut fine, fine_width, self.blur * self.fine() as f64);
        let mut level = vec![0.0; width * height];
        for (k, value) in fine.iter().enumerate() {
            let (u, v) = (k % fine_width, k / fine_width);
            level[v / self.fine() * width + u / self.fine()] +=
                value / (self.fine() * self.fine()) as f64;
        }
        level
    }

    /// Whether each pixel sees the sheet, which ends one pitch beyond the outer dots' centres.
    fn sheet(&self) -> Vec<bool> {
        let [columns, rows] = self.board.grid();
        let half =
            (DVec2::new(f64::from(columns), f64::from(rows)) + 1.0) / 2.0 * self.board.pitch_mm();
        let camera = self.pose.inverse();
        let origin = camera.translation_mm;
        (0..self.lens.height_px)
            .flat_map(|v| (0..self.lens.width_px).map(move |u| (u, v)))
            .map(|(u, v)| {
                let ray = camera.direction(self.lens.ray(DVec2::new(f64::from(u), f64::from(v))));
                let at = origin - ray * (origin.z / ray.z);
                at.x.abs() <= half.x && at.y.abs() <= half.y && origin.z / ray.z < 0.0
            })
            .collect()
    }

    pub fn image(&self) -> BoardImage {
        let (width, height) = (self.lens.width_px as usize, self.lens.height_px as usize);
        let clean = self.clean();
        let of =
            |level: f64| self.noise.max(0.01).powi(2) * (0.0025 + 0.06 * level.max(0.0) / 188.0);
        let mut draw = Draw(self.seed);
        BoardImage {
            width,
            height,
            level: clean
                .iter()
                .map(|&l| {
                    let noise = if self.noise > 0.0 {
                        draw.normal() * of(l).sqrt()
                    } else {
                        0.0
                    };
                    (l + noise) as f32
                })
                .collect(),
            variance: clean.iter().map(|&l| of(l) as f32).collect(),
        }
    }
}

/// Clips a polygon to the part where `side` is not negative.
fn cut(polygon: &[DVec2], side: impl Fn(DVec2) -> f64) -> Vec<DVec2> {
    let mut kept = Vec::new();
    for (k, &a) in polygon.iter().enumerate() {
        let b = polygon[(k + 1) % polygon.len()];
        let (da, db) = (side(a), side(b));
        if da >= 0.0 {
            kept.push(a);
        }
        if (da >= 0.0) != (db >= 0.0) {
            kept.push(a + (b - a) * (da / (da - db)));
        }
    }
    kept
}

pub fn area_and_centroid(polygon: &[DVec2]) -> (f64, DVec2) {
    let Some(&origin) = polygon.first() else {
        return (0.0, DVec2::ZERO);
    };
    let (mut area, mut moment) = (0.0, DVec2::ZERO);
    for (k, &a) in polygon.iter().enumerate() {
        let (a, b) = (a - origin, polygon[(k + 1) % polygon.len()] - origin);
        let cross = 0.5 * a.perp_dot(b);
        area += cross;
        moment += cross * (a + b) / 3.0;
    }
    (area.abs(), origin + moment / area)
}

fn blur(fine: &mut [f64], width: usize, sigma: f64) {
    if sigma == 0.0 {
        return;
    }
    let reach = (6.0 * sigma).ceil() as isize;
    let weights: Vec<f64> = (-reach..=reach)
        .map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp())
        .collect();
    let sum: f64 = weights.iter().sum();
    let height = fine.len() / width;
    let near =
        |at: usize, k: isize, count: usize| (at as isize + k).clamp(0, count as isize - 1) as usize;
    let mut across = vec![0.0; fine.len()];
    for (from, to) in fine.chunks_exact(width).zip(across.chunks_exact_mut(width)) {
        for (k, w) in (-reach..=reach).zip(&weights) {
            for (u, value) in to.iter_mut().enumerate() {
                *value += w / sum * from[near(u, k, width)];
            }
        }
    }
    for (v, to) in fine.chunks_exact_mut(width).enumerate() {
        to.fill(0.0);
        for (k, w) in (-reach..=reach).zip(&weights) {
            let from = &across[near(v, k, height) * width..][..width];
            for (value, from) in to.iter_mut().zip(from) {
                *value += w / sum * from;
            }
        }
    }
}

/// Pseudo-random numbers: uniform by SplitMix64, normal by Box-Muller.
pub struct Draw(pub u64);

impl Draw {
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn normal(&mut self) -> f64 {
        let (a, b) = (self.uniform(), self.uniform());
        (-2.0 * (1.0 - a).ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    }
}
