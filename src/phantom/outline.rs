//! The smooth outline of a trunk: cross-sections between an ellipse and a rectangle around a
//! straight axis, with a core of bone and muscle that scales with stature, and a layer over it
//! whose thickness follows from body mass.
//!
//! Body frame: the patient's axes (x left, y posterior, z to the head) with the origin on the axis
//! at the height of the tip of the breastbone, in millimetres.
//!
//! Proportions follow the mean adult: heights of landmarks, breadths and depths from Gordon et al.,
//! "1988 Anthropometric Survey of U.S. Army Personnel", NATICK/TR-89/044, with the core on the lean side
//! of the mean. The trunk between the notch of the breastbone and the hip joints has 43.46 % (male) or
//! 42.57 % (female) of the body's mass at a mass index of 24 kg/m2 (de Leva, J. Biomechanics 29, 1996,
//! table 4), and 0.6 % of this fraction more for each further kg/m2, which is the slope of Pearsall,
//! Reid and Ross, Annals of Biomedical Engineering 22, 1994, for a man of 175 cm. The trunk, lungs
//! included, is given the density of water. Children are modelled as small adults.

use super::parameters::{Patient, Sex};
use super::spline::Spline;

/// Height of the first table row, relative to stature.
pub(super) const FIRST: f64 = -0.24;
/// Distance of table rows, relative to stature.
pub(super) const STEP: f64 = 0.02;
pub(super) const ROWS: usize = 24;
/// Stature of the tables.
pub(super) const STATURE_MM: f64 = 1760.0;

/// Tables of one sex: core, and relative thickness of the layer over it.
struct Table {
    side: [f64; ROWS],
    front: [f64; ROWS],
    back: [f64; ROWS],
    over_side: [f64; ROWS],
    over_front: [f64; ROWS],
    over_back: [f64; ROWS],
    share: f64,
}

const OVER_BACK: [f64; ROWS] = [
    0.9, 0.9, 0.95, 0.95, 0.9, 0.85, 0.8, 0.8, 0.8, 0.75, 0.7, 0.65, 0.65, 0.6, 0.6, 0.6, 0.6,
    0.55, 0.5, 0.45, 0.4, 0.4, 0.4, 0.4,
];

const MALE: Table = Table {
    side: [
        150., 158., 163., 166., 165., 160., 152., 143., 136., 132., 132., 136., 141., 146., 150.,
        154., 160., 168., 170., 148., 82., 52., 57., 57.,
    ],
    front: [
        70., 78., 84., 86., 84., 80., 76., 74., 74., 76., 81., 88., 96., 102., 105., 104., 99.,
        88., 70., 54., 46., 46., 50., 50.,
    ],
    back: [
        84., 96., 104., 107., 106., 100., 93., 88., 86., 87., 91., 96., 100., 102., 103., 103.,
        102., 98., 90., 74., 60., 54., 54., 56.,
    ],
    over_side: [
        1.0, 1.0, 1.0, 1.0, 1.0, 1.05, 1.15, 1.3, 1.4, 1.4, 1.3, 1.15, 1.05, 1.0, 0.95, 0.9, 0.9,
        0.85, 0.75, 0.6, 0.45, 0.35, 0.35, 0.35,
    ],
    over_front: [
        0.9, 0.9, 1.0, 1.1, 1.3, 1.55, 1.85, 2.1, 2.2, 2.15, 2.0, 1.75, 1.4, 1.1, 0.9, 0.75, 0.65,
        0.55, 0.5, 0.45, 0.4, 0.35, 0.35, 0.35,
    ],
    over_back: OVER_BACK,
    share: 0.4346,
};

const FEMALE: Table = Table {
    side: [
        158., 168., 174., 176., 173., 165., 152., 138., 128., 123., 122., 125., 129., 133., 137.,
        141., 147., 154., 156., 135., 74., 46., 51., 51.,
    ],
    front: [
        70., 78., 84., 86., 84., 79., 75., 72., 72., 74., 78., 84., 91., 97., 100., 99., 94., 84.,
        67., 52., 44., 44., 48., 48.,
    ],
    back: [
        86., 99., 108., 111., 109., 101., 92., 87., 85., 86., 90., 95., 98., 100., 101., 101., 99.,
        95., 87., 71., 57., 51., 51., 53.,
    ],
    over_side: [
        1.4, 1.45, 1.5, 1.5, 1.5, 1.45, 1.4, 1.35, 1.3, 1.25, 1.15, 1.05, 1.0, 0.95, 0.9, 0.85,
        0.8, 0.75, 0.7, 0.55, 0.4, 0.35, 0.35, 0.35,
    ],
    over_front: [
        1.0, 1.0, 1.1, 1.2, 1.35, 1.5, 1.65, 1.75, 1.75, 1.65, 1.5, 1.3, 1.1, 0.9, 0.8, 0.7, 0.6,
        0.5, 0.45, 0.4, 0.35, 0.35, 0.35, 0.35,
    ],
    over_back: OVER_BACK,
    share: 0.4257,
};

/// Heights of the ends of the body, relative to stature.
pub(super) const LOWER_END: f64 = -0.21;
pub(super) const UPPER_END: f64 = 0.2;
/// Lengths of the rounded ends, relative to stature.
const LOWER_CAP: f64 = 0.035;
const UPPER_CAP: f64 = 0.02;
/// Heights between which the trunk's fraction of the body mass is known, relative to stature: hip joints
/// and notch of the breastbone.
const HIPS: f64 = -0.16;
const NOTCH: f64 = 0.122;

/// Allowed scale of the layer: from skin with the thinnest fat to more than that of any patient on a
/// couch.
const LAYER_MM: [f64; 2] = [1.5, 70.0];

/// Area of |x/a|^2.5 + |y/b|^2.5 <= 1 relative to its bounding box: gamma(1.4)^2 / gamma(1.8).
const FILL: f64 = 0.845_233_8;

/// The outline of one patient.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Outline {
    /// Half width over z.
    pub(super) side: Spline,
    /// Distances of front and back from the axis, over z.
    pub(super) front: Spline,
    pub(super) back: Spline,
    /// Half width, front and back distance of bone and muscle, over z.
    pub(super) core: [Spline; 3],
    /// Scale of the layer over the core.
    pub(super) layer_mm: f64,
    pub(super) stature_mm: f64,
}

fn table(sex: Sex) -> &'static Table {
    match sex {
        Sex::Female => &FEMALE,
        Sex::Male => &MALE,
    }
}

/// Volume between hips and notch in cubic millimetres, as coefficients of a polynomial in the
/// layer's scale.
fn volumes_mm3(p: &Patient) -> [f64; 3] {
    let t = table(p.sex);
    let scale = p.stature_mm / STATURE_MM;
    let row = |values: &[f64; ROWS]| Spline::new(FIRST, STEP, values.to_vec());
    let core = [&t.side, &t.front, &t.back].map(row);
    let over = [&t.over_side, &t.over_front, &t.over_back].map(row);
    const SLICES: usize = 200;
    let mut sums = [0.0; 3];
    for i in 0..SLICES {
        let z = HIPS + (NOTCH - HIPS) * (i as f64 + 0.5) / SLICES as f64;
        let [a, front, back] = [0, 1, 2].map(|i| core[i].at(z) * scale);
        let [over_a, over_front, over_back] = [0, 1, 2].map(|i| over[i].at(z));
        let (b, over_b) = (front + back, over_front + over_back);
        sums[0] += a * b;
        sums[1] += a * over_b + over_a * b;
        sums[2] += over_a * over_b;
    }
    let thick = (NOTCH - HIPS) * p.stature_mm / SLICES as f64;
    sums.map(|sum| 2.0 * FILL * sum * thick)
}

/// Volume of the trunk for a body mass, in cubic millimetres.
fn trunk_mm3(p: &Patient, mass_kg: f64) -> f64 {
    let index = mass_kg / (p.stature_mm * 1e-3).powi(2);
    1e6 * mass_kg * table(p.sex).share * (1.0 + 0.006 * (index - 24.0))
}

/// Volume of the breasts in cubic millimetres.
fn breasts_mm3(p: &Patient) -> f64 {
    1e3 * p.chest.breast_ml.iter().sum::<f64>()
}

impl Outline {
    pub(super) fn new(p: &Patient) -> Self {
        let t = table(p.sex);
        let scale = p.stature_mm / STATURE_MM;
        let [c, b, a] = volumes_mm3(p);
        let missing = trunk_mm3(p, p.mass_kg) - breasts_mm3(p) - c;
        // Root of a g^2 + b g = missing that increases with `missing`.
        let root = (b * b + 4.0 * a * missing).max(0.0).sqrt();
        let layer_mm = (2.0 * missing / (b + root)).clamp(LAYER_MM[0], LAYER_MM[1]);
        let spline = |core: &[f64; ROWS], over: &[f64; ROWS], layer: f64| {
            let rows = core.iter().zip(over).map(|(c, o)| c * scale + o * layer);
            Spline::new(FIRST * p.stature_mm, STEP * p.stature_mm, rows.collect())
        };
        let parts = [
            (&t.side, &t.over_side),
            (&t.front, &t.over_front),
            (&t.back, &t.over_back),
        ];
        let [side, front, back] = parts.map(|(c, o)| spline(c, o, layer_mm));
        Self {
            side,
            front,
            back,
            core: parts.map(|(c, o)| spline(c, o, 0.0)),
            layer_mm,
            stature_mm: p.stature_mm,
        }
    }

    /// Returns the minimum and maximum mass of a body with these dimensions, in kg.
    pub(super) fn masses_kg(p: &Patient) -> [f64; 2] {
        let [c, b, a] = volumes_mm3(p);
        LAYER_MM.map(|g| {
            let volume = c + g * (b + g * a) + breasts_mm3(p);
            // The trunk's share depends on the mass; the iteration converges quickly.
            (0..60).fold(volume / (1e6 * 0.43), |mass, _| {
                mass * volume / trunk_mm3(p, mass).max(1.0)
            })
        })
    }

    /// Returns the distance of the outline from the axis, before the ends are rounded, in
    /// millimetres. `sin` and `cos` are of the angle from x towards y.
    pub(super) fn radius(&self, sin: f64, cos: f64, z: f64) -> f64 {
        radius(
            [self.side.at(z), self.front.at(z), self.back.at(z)],
            sin,
            cos,
        )
    }

    /// Returns the distance of bone and muscle from the axis, before the ends are rounded, in
    /// millimetres.
    pub(super) fn core_radius(&self, sin: f64, cos: f64, z: f64) -> f64 {
        radius([0, 1, 2].map(|i| self.core[i].at(z)), sin, cos)
    }

    /// Heights of the ends of the body towards the feet and the head.
    pub(super) fn ends(&self) -> [f64; 2] {
        [LOWER_END, UPPER_END].map(|end| end * self.stature_mm)
    }

    /// Scale factor of cross-sections that rounds the ends: 1 between the rounded ends, 0 at and beyond
    /// both ends of the body.
    pub(super) fn cap(&self, z: f64) -> f64 {
        let h = z / self.stature_mm;
        let into = ((LOWER_END + LOWER_CAP - h) / LOWER_CAP)
            .max((h - UPPER_END + UPPER_CAP) / UPPER_CAP)
            .max(0.0);
        (1.0 - into.powf(2.5)).max(0.0).powf(0.4)
    }
}

fn radius([side, front, back]: [f64; 3], sin: f64, cos: f64) -> f64 {
    let depth = if sin < 0.0 { front } else { back };
    let bent = |v: f64| v * v * v.abs().sqrt();
    (bent(cos / side).abs() + bent(sin / depth).abs()).powf(-0.4)
}

#[cfg(test)]
mod tests {
    use super::super::parameters::Patient;
    use super::*;
    use std::f64::consts::TAU;

    fn weighed_kg(p: &Patient) -> f64 {
        let outline = Outline::new(p);
        let (lo, hi) = (HIPS * p.stature_mm, NOTCH * p.stature_mm);
        const N: usize = 180;
        let mut volume = breasts_mm3(p);
        for i in 0..N {
            let z = lo + (hi - lo) * (i as f64 + 0.5) / N as f64;
            for k in 0..N {
                let (sin, cos) = (TAU * (k as f64 + 0.5) / N as f64).sin_cos();
                let r = outline.radius(sin, cos, z);
                volume += r * r / 2.0 * TAU / N as f64 * (hi - lo) / N as f64;
            }
        }
        volume * 1e-6
    }

    #[test]
    fn trunk_has_the_share_of_the_body_mass() {
        let mut p = Patient::load("p01-woman-mean").unwrap();
        for (mass, index) in [
            (55.0, 55.0 / 1.63f64.powi(2)),
            (95.0, 95.0 / 1.63f64.powi(2)),
        ] {
            (p.mass_kg, p.stature_mm) = (mass, 1630.0);
            let share = 0.4257 * (1.0 + 0.006 * (index - 24.0));
            let found = weighed_kg(&p) / mass;
            assert!((found / share - 1.0).abs() < 1e-3, "{found} {share}");
        }
        // At the ends of the mass range, the layer is at the ends of its own range.
        for (mass, layer) in Outline::masses_kg(&p).into_iter().zip(LAYER_MM) {
            p.mass_kg = mass;
            assert!((Outline::new(&p).layer_mm / layer - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn bone_and_muscle_are_under_the_skin() {
        let p = Patient::load("p01-woman-mean").unwrap();
        let outline = Outline::new(&p);
        for i in 0..200 {
            let z = (LOWER_END + 0.002 * f64::from(i)) * p.stature_mm;
            let (sin, cos) = (f64::from(i) * 0.7).sin_cos();
            assert!(outline.core_radius(sin, cos, z) < outline.radius(sin, cos, z));
        }
        let [lo, hi] = outline.ends();
        assert_eq!(
            (outline.cap(lo), outline.cap(hi), outline.cap(0.0)),
            (0.0, 0.0, 1.0)
        );
    }
}
