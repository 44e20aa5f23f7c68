//! Organs in the body frame at the reference phase: the cavity within ribs and abdominal wall, the
//! diaphragm's domes, two lungs with their fissures, the heart and the spine.
//!
//! Distances are signed, negative inside, and approximately in millimetres near a surface: they
//! determine the side and the partial volume of a voxel at the border, but are not accurate
//! elsewhere.
//!
//! At end-exhale the right dome is 2 cm above the tip of the breastbone and the left dome is 12 mm
//! lower, and the lungs including tissue have a volume of some 4 litres in a man (functional residual
//! capacity 3.3 l and 0.5 kg of tissue: ICRP Publication 89, 2002).

use super::outline::{FIRST, ROWS, STATURE_MM, STEP};
use super::parameters::{Lobe, Patient, Sex};
use super::real::Real;
use super::spline::Spline;
use glam::DVec3;

const SIDE: [f64; ROWS] = [
    118., 125., 130., 130., 128., 125., 122., 119., 118., 118., 119., 122., 126., 129., 131., 130.,
    125., 112., 88., 60., 44., 40., 40., 40.,
];
const FRONT: [f64; ROWS] = [
    45., 52., 58., 62., 62., 61., 60., 60., 61., 63., 67., 73., 80., 86., 89., 87., 80., 66., 50.,
    38., 32., 30., 30., 30.,
];
const BACK: [f64; ROWS] = [
    55., 62., 68., 72., 74., 74., 74., 74., 75., 77., 80., 84., 88., 90., 91., 90., 86., 78., 66.,
    52., 42., 38., 38., 38.,
];
/// Linear size of a woman's cavity relative to the cavity of a man of the same stature.
const FEMALE: f64 = 0.93;

/// The organs of one patient.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Organs {
    side: Spline,
    front: Spline,
    back: Spline,
    /// Stature of the patient divided by the stature of the tables.
    scale: f64,
    /// Scale factor across the body: `scale`, or less for women.
    across: f64,
    stature_mm: f64,
}

/// Centre and height of the right and the left dome, in units of the tables.
const DOMES: [([f64; 2], f64); 2] = [([-66.0, 0.0], 22.0), ([66.0, 0.0], 10.0)];
/// Centre and half axes of the heart, in units of the tables.
const HEART: ([f64; 3], [f64; 3]) = ([24.0, -34.0, 48.0], [50.0, 44.0, 58.0]);
/// Centre and radius of the spine, in units of the tables.
const SPINE: ([f64; 2], f64) = ([0.0, 62.0], 24.0);
/// Half the width of the mediastinum above the heart.
const BETWEEN: f64 = 25.0;

impl Organs {
    pub(super) fn new(p: &Patient) -> Self {
        let scale = p.stature_mm / STATURE_MM;
        let across = match p.sex {
            Sex::Female => scale * FEMALE,
            Sex::Male => scale,
        };
        let spline = |rows: &[f64; ROWS]| {
            let rows = rows.iter().map(|v| v * across).collect();
            Spline::new(FIRST * p.stature_mm, STEP * p.stature_mm, rows)
        };
        Self {
            side: spline(&SIDE),
            front: spline(&FRONT),
            back: spline(&BACK),
            scale,
            across,
            stature_mm: p.stature_mm,
        }
    }

    /// Returns the relative position between the axis (0) and the cavity's wall (1): (distance from
    /// the axis / distance of the wall from the axis)^2.5, which is twice continuously
    /// differentiable.
    pub(super) fn cavity<T: Real>(&self, [x, y, z]: [T; 3]) -> T {
        let depth = if y.value() < 0.0 {
            &self.front
        } else {
            &self.back
        };
        let (a, b) = (self.side.at(z), depth.at(z));
        (x * inverse(a)).abs_pow_5_2() + (y * inverse(b)).abs_pow_5_2()
    }

    /// Signed distance from the cavity, positive outside.
    pub(super) fn wall(&self, x: DVec3) -> f64 {
        let depth = if x.y < 0.0 { &self.front } else { &self.back };
        let inwards = self.side.at(x.z).min(depth.at(x.z));
        (self.cavity(x.to_array()).powf(0.4) - 1.0) * inwards
    }

    /// Signed distance from the lungs, positive outside.
    pub(super) fn lungs(&self, x: DVec3) -> f64 {
        let s = self.scale;
        let (u, v) = (x.x.abs() / self.across - 52.0, x.y / self.across);
        let apex = x.z - 0.13 * self.stature_mm + (u * u + v * v) / 110.0 * s;
        let outside = [
            self.wall(x) + 6.0 * s,
            apex,
            self.diaphragm(x),
            -self.between(x),
        ];
        // A smooth maximum, which rounds edges by some 3 mm.
        const ROUND: f64 = 2.0;
        let most = outside.into_iter().fold(f64::MIN, f64::max);
        let sum: f64 = outside.iter().map(|d| ((d - most) / ROUND).exp()).sum();
        most + ROUND * sum.ln()
    }

    /// Distance below the domes of the diaphragm.
    pub(super) fn diaphragm(&self, x: DVec3) -> f64 {
        let height = |(at, top): ([f64; 2], f64)| {
            let u = (x.x / self.across - at[0]) / 66.0;
            let v = (x.y / self.across - at[1]) / 78.0;
            // The dome descends deeper to the recess at the back wall than in front.
            (top - 34.0 * u * u - if v > 0.0 { 52.0 } else { 30.0 } * v * v) * self.scale
        };
        let [right, left] = DOMES.map(height);
        let round = 6.0;
        let most = right.max(left);
        let top =
            most + round * (((right - most) / round).exp() + ((left - most) / round).exp()).ln();
        top - x.z
    }

    /// Signed distance from the mediastinum: heart, spine and the tissue between the lungs.
    pub(super) fn between(&self, x: DVec3) -> f64 {
        let middle = x.x.abs() - BETWEEN * self.across;
        self.heart(x)
            .min(self.spine(x) - 4.0 * self.across)
            .min(middle)
    }

    pub(super) fn heart(&self, x: DVec3) -> f64 {
        let (at, size) = HEART;
        let scale = DVec3::new(self.across, self.across, self.scale);
        let q = (x / scale - DVec3::from_array(at)) / DVec3::from_array(size);
        (q.length() - 1.0) * size[1] * self.across
    }

    pub(super) fn spine(&self, x: DVec3) -> f64 {
        let (at, radius) = SPINE;
        (x.x - at[0] * self.across).hypot(x.y - at[1] * self.across) - radius * self.across
    }

    /// Signed distance from the ribs, which slope down to the front within the cavity's wall.
    pub(super) fn ribs(&self, x: DVec3) -> f64 {
        let s = self.scale;
        let shell = (self.wall(x) - 4.0 * s).abs() - 3.5 * s;
        let along = x.z - 0.45 * x.y;
        let turn = (along / (27.0 * s)).rem_euclid(1.0) - 0.5;
        let rib = turn.abs() * 27.0 * s - 6.0 * s;
        let caged = (-0.04 * self.stature_mm - x.z).max(x.z - 0.125 * self.stature_mm);
        shell.max(rib).max(caged)
    }

    /// Signed distance from the liver, which fills the right half under the dome.
    pub(super) fn liver(&self, x: DVec3) -> f64 {
        let low = -0.065 * self.stature_mm + 0.35 * x.x - x.z;
        let left = x.x - 40.0 * self.across;
        (4.0 * self.scale - self.diaphragm(x))
            .max(self.wall(x) + 6.0 * self.scale)
            .max(low)
            .max(left)
            .max(6.0 * self.scale - self.spine(x))
    }

    /// Returns the lobe of a point in a lung.
    pub(super) fn lobe(&self, x: DVec3) -> Option<Lobe> {
        if self.lungs(x) > 0.0 {
            return None;
        }
        // The oblique fissures run from high in the back to low in the front.
        let s = self.scale;
        let lower = x.z < 66.0 * s + 0.73 * x.y;
        let middle = x.z < 97.0 * s;
        Some(match (x.x < 0.0, lower, middle) {
            (true, true, _) => Lobe::RightLower,
            (true, false, true) => Lobe::RightMiddle,
            (true, false, false) => Lobe::RightUpper,
            (false, true, _) => Lobe::LeftLower,
            (false, false, _) => Lobe::LeftUpper,
        })
    }

    /// Default position of tumours in a lobe.
    pub(super) fn place(&self, lobe: Lobe) -> DVec3 {
        let at = match lobe {
            Lobe::RightUpper => [-66.0, -4.0, 148.0],
            Lobe::RightMiddle => [-78.0, -40.0, 74.0],
            Lobe::RightLower => [-76.0, 42.0, 46.0],
            Lobe::LeftUpper => [66.0, -4.0, 148.0],
            Lobe::LeftLower => [78.0, 44.0, 48.0],
        };
        DVec3::from_array(at) * DVec3::new(self.across, self.across, self.scale)
    }
}

/// 1 / v for a non-zero v.
fn inverse<T: Real>(v: T) -> T {
    let value = v.value();
    v.chain(1.0 / value, -1.0 / (value * value))
}
