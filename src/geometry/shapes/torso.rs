//! A human torso lying on its back: superelliptic cross-sections whose width, thickness and height
//! follow smooth profiles from the neck to the hips, with relief on the front (chest, breastbone,
//! collar bones, edge of the ribs, abdomen, navel) and seeded variation. All functions are analytic
//! and smooth, so the surface has a tangent plane everywhere except at the cut ends.

use super::loft::{equal_lengths, loft};
use super::{Violation, clamped, within};
use crate::Mesh;
use glam::DVec3;
use std::f64::consts::TAU;
use std::ops::RangeInclusive;

/// Parameters of a torso. The mesh fills the box of the given size exactly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Torso {
    /// Seed of the variation; 0 is the mean torso, without variation.
    pub seed: u64,
    /// Length from the cut neck to the cut hips (along y), 50 to 5000 mm.
    pub length_mm: f64,
    /// Width across the shoulders (along x), 50 to 5000 mm.
    pub width_mm: f64,
    /// Depth from the back to the highest point of the front (along z), 20 to 2000 mm.
    pub depth_mm: f64,
    /// Number of triangles, 1000 to 10,000,000; the mesh has this number to within a few per cent.
    pub triangles: u32,
}

impl Default for Torso {
    fn default() -> Self {
        Self {
            seed: 0,
            length_mm: 500.0,
            width_mm: 380.0,
            depth_mm: 220.0,
            triangles: 65_000,
        }
    }
}

const SIDES_MM: RangeInclusive<f64> = 50.0..=5000.0;
const DEPTH_MM: RangeInclusive<f64> = 20.0..=2000.0;
const TRIANGLES: RangeInclusive<f64> = 1000.0..=1e7;

impl Torso {
    /// Checks that the parameters are in range.
    ///
    /// # Errors
    /// Returns the first field out of range.
    pub fn check(&self) -> Result<(), Violation> {
        within("length_mm", self.length_mm, SIDES_MM)?;
        within("width_mm", self.width_mm, SIDES_MM)?;
        within("depth_mm", self.depth_mm, DEPTH_MM)?;
        within("triangles", f64::from(self.triangles), TRIANGLES)
    }
}

/// Generates a torso. Parameters that [`Torso::check`] rejects are clamped to their ranges.
pub fn torso(params: &Torso) -> Mesh {
    let size = DVec3::new(
        clamped(params.width_mm, SIDES_MM),
        clamped(params.length_mm, SIDES_MM),
        clamped(params.depth_mm, DEPTH_MM),
    );
    let triangles = clamped(f64::from(params.triangles), TRIANGLES);
    let body = Body::new(params.seed);
    // A ring is about twice as long as the torso.
    let points = ((2.0 * triangles / 2.0).sqrt() / 4.0).round() as usize * 4;
    let rings = (triangles / 2.0 / points as f64).round().max(8.0) as usize;
    // Rings are denser where the outline runs across, at the shoulders.
    let step = 1e-4;
    let along = equal_lengths(rings, |s| {
        let slope = (body.half_width(s + step) - body.half_width(s - step)) / (2.0 * step);
        LENGTH.hypot(slope)
    });
    let mut mesh = loft(rings + 1, points, |ring, k| {
        body.surface(along[ring], TAU * k as f64 / points as f64)
    });
    fit(&mut mesh, size);
    mesh
}

/// Scales a mesh to fill its box exactly.
fn fit(mesh: &mut Mesh, size: DVec3) {
    let Some((lo, hi)) = mesh.bounds() else {
        return;
    };
    let scale = size / (hi - lo);
    let middle = (lo + hi) / 2.0;
    for v in &mut mesh.vertices {
        *v = DVec3::new(
            (v.x - middle.x) * scale.x,
            (v.y - middle.y) * scale.y,
            // The lowest point of the back is exactly at z = 0.
            (v.z - hi.z) * scale.z,
        );
    }
}

/// Length of the unscaled torso in millimetres, from which the proportions follow.
const LENGTH: f64 = 500.0;

struct Body {
    waves: Vec<Wave>,
    /// Factors of seeded variation: waist, chest relief, abdomen, hips.
    waist: f64,
    chest: f64,
    abdomen: f64,
    hips: f64,
}

struct Wave {
    across: f64,
    along: f64,
    phase: f64,
    height: f64,
}

impl Body {
    fn new(seed: u64) -> Self {
        let mut random = Random(seed);
        let vary = if seed == 0 { 0.0 } else { 1.0 };
        let mut around = |spread: f64| 1.0 + vary * spread * (2.0 * random.next() - 1.0);
        let (waist, chest, abdomen, hips) = (around(0.05), around(0.5), around(0.6), around(0.05));
        let waves = (0..10)
            .map(|_| {
                let wavelength = 110.0 + 240.0 * random.next();
                let direction = TAU * random.next();
                Wave {
                    across: TAU / wavelength * direction.cos(),
                    along: TAU / wavelength * direction.sin(),
                    phase: TAU * random.next(),
                    // Shorter waves have smaller amplitudes, so that curvature stays bounded.
                    height: vary * 1.6 * (wavelength / 350.0) * random.next(),
                }
            })
            .collect();
        Self {
            waves,
            waist,
            chest,
            abdomen,
            hips,
        }
    }

    /// Half the width at `s`, from the neck (0) to the hips (1).
    fn half_width(&self, s: f64) -> f64 {
        let neck = 62.0;
        let shoulders = step(s, 0.105, 0.052);
        let body = 176.0 - 20.0 * self.waist * bump(s, 0.70, 0.16) + 14.0 * bump(s, 0.24, 0.10)
            - 6.0 * (1.0 - self.hips) * step(s, 0.9, 0.08) * 10.0;
        neck + (body - neck) * shoulders
    }

    /// Half the thickness.
    fn half_depth(&self, s: f64) -> f64 {
        let neck = 58.0;
        let body = 97.0 + 9.0 * bump(s, 0.38, 0.17) - 7.0 * bump(s, 0.68, 0.15);
        neck + (body - neck) * step(s, 0.12, 0.07)
    }

    /// Height of the lowest line of the back above the couch: the neck and the small of the back
    /// are raised.
    fn lift(&self, s: f64) -> f64 {
        26.0 * (1.0 - step(s, 0.11, 0.06)) + 5.0 * bump(s, 0.72, 0.12)
    }

    /// Returns the point at `s` along the torso and `angle` around it, from the left side (+x) over
    /// the front.
    fn surface(&self, s: f64, angle: f64) -> DVec3 {
        // Exponent of the Lame curve, between an ellipse (2) and a rectangle.
        const ROUNDNESS: f64 = 2.5;
        let (sin, cos) = angle.sin_cos();
        let lame = (cos.abs().powf(ROUNDNESS) + sin.abs().powf(ROUNDNESS)).powf(-1.0 / ROUNDNESS);
        let (half_width, half_depth) = (self.half_width(s), self.half_depth(s));
        let x = half_width * cos * lame;
        let height = half_depth * (1.0 + sin * lame) + self.lift(s);
        let y = (s - 0.5) * LENGTH;
        // The relief grows from zero at the sides to its full height on top.
        let front = (0.5 + 0.5 * sin).powi(3);
        DVec3::new(x, y, -(height + front * self.relief(x, s * LENGTH)))
    }

    /// Height of the relief on the front in millimetres, at the position x across and the distance `y`
    /// from the neck.
    fn relief(&self, x: f64, y: f64) -> f64 {
        let hill = |x0: f64, y0: f64, wide: f64, long: f64| {
            (-0.5 * (((x - x0) / wide).powi(2) + ((y - y0) / long).powi(2))).exp()
        };
        let chest =
            17.0 * self.chest * (hill(82.0, 165.0, 46.0, 44.0) + hill(-82.0, 165.0, 46.0, 44.0));
        let breastbone = -4.0 * hill(0.0, 150.0, 20.0, 60.0);
        let collar = 2.5 * (hill(75.0, 72.0, 42.0, 14.0) + hill(-75.0, 72.0, 42.0, 14.0));
        let notch = -4.0 * hill(0.0, 62.0, 20.0, 18.0);
        // The edge of the ribs arches over the abdomen.
        let arch = 240.0 + 55.0 * (x / 110.0).powi(2);
        let ribs = 5.0 * (-0.5 * ((y - arch) / 26.0).powi(2) - 0.5 * (x / 105.0).powi(2)).exp();
        let abdomen = 7.0 * self.abdomen * hill(0.0, 385.0, 75.0, 62.0);
        let midline = -1.8 * hill(0.0, 320.0, 15.0, 70.0);
        let navel = -6.5 * hill(0.0, 385.0, 13.0, 12.0);
        let own: f64 = self
            .waves
            .iter()
            .map(|w| w.height * (w.across * x + w.along * y + w.phase).cos())
            .sum();
        chest + breastbone + collar + notch + ribs + abdomen + midline + navel + own
    }
}

/// A smooth step from 0 to 1 at `at`.
fn step(s: f64, at: f64, width: f64) -> f64 {
    0.5 + 0.5 * ((s - at) / width).tanh()
}

fn bump(s: f64, at: f64, width: f64) -> f64 {
    (-0.5 * ((s - at) / width).powi(2)).exp()
}

/// SplitMix64 (G. Steele, D. Lea and C. Flood, "Fast Splittable Pseudorandom Number Generators",
/// 2014), for the seeded variation.
struct Random(u64);

impl Random {
    /// Uniform in [0, 1).
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::super::check;
    use super::*;

    #[test]
    fn mesh_is_closed_smooth_and_of_the_requested_size() {
        for seed in [0, 1, 2, 77] {
            let params = Torso {
                seed,
                ..Torso::default()
            };
            params.check().unwrap();
            let mesh = torso(&params);
            let volume = check::closed(&mesh);
            // A torso fills about 60 % of its box.
            let fill = volume / (500.0 * 380.0 * 220.0);
            assert!((0.5..0.75).contains(&fill), "{fill}");
            let (lo, hi) = mesh.bounds().unwrap();
            assert!(
                (lo - DVec3::new(-190.0, -250.0, -220.0)).length() < 1e-9,
                "{lo}"
            );
            assert!((hi - DVec3::new(190.0, 250.0, 0.0)).length() < 1e-9, "{hi}");
            let count = mesh.triangles.len() as f64;
            assert!((count / 65_000.0 - 1.0).abs() < 0.03, "{count}");
            let angle = check::sharpest_deg(&mesh, |v| v.y.abs() > 249.999);
            assert!(angle < 12.0, "seed {seed}: {angle} degrees");
        }
    }

    #[test]
    fn seed_determines_the_shape_of_the_body() {
        let small = |seed| {
            torso(&Torso {
                seed,
                triangles: 3000,
                ..Torso::default()
            })
        };
        assert_eq!(small(5), small(5));
        let (a, b) = (small(5), small(6));
        let worst = (a.vertices.iter().zip(&b.vertices))
            .map(|(a, b)| (*a - *b).length())
            .fold(0.0, f64::max);
        assert!((3.0..60.0).contains(&worst), "{worst}");
    }

    #[test]
    fn the_navel_is_a_dip_and_the_chest_is_not() {
        let body = Body::new(0);
        assert!(body.relief(0.0, 385.0) < body.relief(0.0, 420.0));
        assert!(body.relief(82.0, 165.0) > body.relief(0.0, 165.0) + 8.0);
        assert!(body.half_width(0.0) < 0.45 * body.half_width(0.25));
        assert!(body.half_width(0.7) < 0.92 * body.half_width(0.25));
    }

    #[test]
    fn parameters_out_of_range_are_named_and_do_not_panic() {
        let mad = Torso {
            seed: 1,
            length_mm: f64::NAN,
            width_mm: -1.0,
            depth_mm: f64::INFINITY,
            triangles: 0,
        };
        assert_eq!(mad.check().unwrap_err().0, "length_mm");
        check::closed(&torso(&mad));
    }
}
