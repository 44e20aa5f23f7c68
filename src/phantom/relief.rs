//! Relief on the outline: breasts or chest muscles, collar bones, edge of the ribs, navel, folds,
//! the groove of the spine, a scar, and individual waves.
//!
//! Positions are along the skin: q from the middle of the front to the patient's left, measured on
//! the chest's mean circle, and z towards the head, both in millimetres. All features are smooth
//! functions of the angle and z.

use super::outline::{Outline, STATURE_MM};
use super::parameters::{Patient, Scar};
use super::random::Draws;
use super::real::Real;
use std::f64::consts::{PI, TAU};

/// Number of individual waves.
const WAVES: i64 = 8;
/// Random-number stream for the individual variation.
const STREAM: u32 = 1;
/// Exponent k of a breast's profile exp(-(r^2/2)^k), fuller than a Gaussian.
const FULLNESS: f64 = 1.3;
/// Volume of this profile relative to the volume of a Gaussian: gamma(1/k)/k.
const FULL_VOLUME: f64 = 0.915_0;
/// Extent of the lower part of a breast, relative to its width.
const BELOW: f64 = 0.78;
/// Extent of the upper part of a breast, relative to its width.
const ABOVE: f64 = 1.12;

/// The relief of one patient.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Relief {
    /// Stature of the patient divided by the stature of the tables.
    scale: f64,
    /// Mean radius of the chest.
    chest_mm: f64,
    stature_mm: f64,
    /// Right and left breast.
    breasts: [Option<Breast>; 2],
    fold_mm: f64,
    navel_mm: f64,
    /// Visibility of bones and muscles under the layer, 0 to 1.
    lean: f64,
    /// Variation factors of muscles, ribs and midline.
    own: [f64; 3],
    waves: Vec<Wave>,
    scar: Option<Scar>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Breast {
    at_mm: [f64; 2],
    width_mm: f64,
    height_mm: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Wave {
    around: f64,
    along: f64,
    phase: f64,
    height_mm: f64,
}

impl Relief {
    pub(super) fn new(p: &Patient, outline: &Outline) -> Self {
        let scale = p.stature_mm / STATURE_MM;
        let at = 0.04 * p.stature_mm;
        let chest_mm = 0.5 * (outline.side.at(at) + outline.front.at(at));
        let draws = Draws::new(p.seed, STREAM);
        let breast = |side: f64, volume_ml: f64| {
            (volume_ml > 0.0).then(|| {
                let width_mm = 44.0 * (volume_ml / 300.0).cbrt();
                let area = TAU * FULL_VOLUME * width_mm * width_mm * 0.5 * (BELOW + ABOVE);
                Breast {
                    // Larger breasts are centred further to the side.
                    at_mm: [
                        side * (76.0 * scale + 0.35 * width_mm),
                        (0.034 * p.stature_mm) - 0.1 * width_mm,
                    ],
                    width_mm,
                    height_mm: 1e3 * volume_ml / area,
                }
            })
        };
        let [right, left] = p.chest.breast_ml;
        let wave = |i: i64| {
            let wavelength_mm = 150.0 + 250.0 * draws.unit(10 * i);
            Wave {
                around: (4.0 * draws.unit(10 * i + 1)).floor(),
                along: TAU / wavelength_mm * draws.even(10 * i + 2),
                phase: TAU * draws.unit(10 * i + 3),
                height_mm: 1.1 * draws.unit(10 * i + 4),
            }
        };
        Self {
            scale,
            chest_mm,
            stature_mm: p.stature_mm,
            breasts: [breast(-1.0, right), breast(1.0, left)],
            fold_mm: p.fold_mm(),
            navel_mm: 5.0 + 0.12 * outline.layer_mm,
            lean: (-(outline.layer_mm - 4.0).max(0.0) / 16.0).exp(),
            own: [0, 1, 2].map(|i| 1.0 + 0.3 * draws.even(1000 + i)),
            waves: (1..=WAVES).map(wave).collect(),
            scar: p.scar,
        }
    }

    /// Returns the height of the skin above the outline, along the radius in millimetres, at an
    /// angle from the middle of the front to the left (-pi to pi) and at z.
    pub(super) fn at(&self, angle: f64, z: f64) -> f64 {
        let q = angle * self.chest_mm;
        let waves: f64 = (self.waves.iter())
            .map(|w| w.height_mm * (w.around * angle + w.along * z + w.phase).cos())
            .sum();
        // All features of the front fade towards the back.
        let front = 1.0 - ((angle.abs() - 1.2) / 1.2).rise();
        let mut height = waves + self.spine(angle, z) + self.folds(angle, q, z);
        if front > 0.0 {
            height += front * (self.bones(q, z) + self.muscles(q, z) + self.breasts(q, z));
            height += front * self.scar(q, z);
        }
        height
    }

    /// A Gaussian hill in units of the tables.
    fn hill(&self, q: f64, z: f64, at: [f64; 2], size: [f64; 2]) -> f64 {
        let s = self.scale;
        let (u, v) = ((q / s - at[0]) / size[0], (z / s - at[1]) / size[1]);
        (-0.5 * (u * u + v * v)).exp()
    }

    fn bones(&self, q: f64, z: f64) -> f64 {
        let hill = |at, size| self.hill(q, z, at, size);
        let both = |x: f64, z, size| hill([x, z], size) + hill([-x, z], size);
        let collar = 3.0 * both(72.0, 206.0, [42.0, 9.0]);
        let notch = -5.0 * hill([0.0, 214.0], [15.0, 13.0]);
        let breastbone = -3.5 * hill([0.0, 80.0], [17.0, 75.0]);
        // The edge of the ribs descends on both sides of the tip of the breastbone.
        let s = self.scale;
        let edge = -12.0 - 62.0 * (q / s / 110.0).powi(2);
        let across = (z / s - edge) / 17.0;
        let ribs = 5.0 * self.own[1] * (-0.5 * (across.powi(2) + (q / s / 95.0).powi(2))).exp();
        self.lean * (collar + notch + breastbone + ribs)
    }

    fn muscles(&self, q: f64, z: f64) -> f64 {
        let hill = |at, size| self.hill(q, z, at, size);
        let both = |x: f64, z, size| hill([x, z], size) + hill([-x, z], size);
        let chest = 8.0 * (0.4 + 0.6 * self.lean) * self.own[0] * both(72.0, 88.0, [46.0, 38.0]);
        let nipples = match self.breasts {
            [None, None] => 2.5 * both(92.0, 62.0, [4.5, 4.5]),
            _ => 0.0,
        };
        let midline = -1.8 * self.lean * self.own[2] * hill([0.0, -80.0], [13.0, 60.0]);
        let navel = -self.navel_mm * hill([0.0, -158.0], [10.0, 8.5]);
        chest + nipples + midline + navel
    }

    fn breasts(&self, q: f64, z: f64) -> f64 {
        (self.breasts.iter().flatten())
            .map(|b| {
                let (u, v) = ((q - b.at_mm[0]) / b.width_mm, (z - b.at_mm[1]) / b.width_mm);
                let v = v / if v < 0.0 { BELOW } else { ABOVE };
                let r2 = 0.5 * (u * u + v * v);
                let nipple = (-0.5 * (r2 * 2.0) * (b.width_mm / 5.5).powi(2)).exp();
                b.height_mm * (-r2.powf(FULLNESS)).exp() + 4.0 * nipple
            })
            .sum()
    }

    /// Height of the skin folds: a groove across the abdomen below the ribs, a groove above the hips
    /// with an overhang above the groove, and two grooves on each flank.
    fn folds(&self, angle: f64, q: f64, z: f64) -> f64 {
        if self.fold_mm <= 0.0 {
            return 0.0;
        }
        let d = self.fold_mm;
        let line = |z: f64, width: f64| (-0.5 * (z / width).powi(2)).exp();
        let across = 1.0 - ((angle.abs() - 0.9) / 0.9).rise();
        let bow = q * q;
        let upper = z + 0.035 * self.stature_mm - bow / 900.0;
        let lower = z + 0.150 * self.stature_mm - bow / 600.0;
        let abdomen =
            -0.7 * line(upper, 8.0) - 1.2 * line(lower, 9.0) + 0.7 * line(lower - 30.0, 20.0);
        let aside = (-0.5 * ((angle.abs() - 1.75) / 0.33).powi(2)).exp();
        let slant = 0.3 * (q.abs() - 1.75 * self.chest_mm);
        let flank = |at: f64| -0.8 * line(z - at * self.stature_mm - slant, 8.0);
        // The depth of a fold varies around the body.
        let deep = 0.8 + 0.2 * (2.0 * angle + 9.0 * self.own[0]).sin();
        let d = d * deep;
        d * (across * abdomen + aside * (flank(-0.045) + flank(-0.095)))
    }

    /// The groove along the spine.
    fn spine(&self, angle: f64, z: f64) -> f64 {
        let q = (PI - angle.abs()) * self.chest_mm / (15.0 * self.scale);
        if q > 8.0 {
            return 0.0;
        }
        let h = z / self.stature_mm;
        let along = ((h + 0.15) / 0.06).rise() * ((0.12 - h) / 0.06).rise();
        -4.0 * (0.4 + 0.6 * self.lean) * along * (-0.5 * q * q).exp()
    }

    fn scar(&self, q: f64, z: f64) -> f64 {
        let Some(scar) = &self.scar else {
            return 0.0;
        };
        let [a, b] = [scar.from_mm, scar.to_mm];
        let (along, off) = ([b[0] - a[0], b[1] - a[1]], [q - a[0], z - a[1]]);
        let length2 = along[0].powi(2) + along[1].powi(2);
        let share = match length2 > 0.0 {
            true => ((off[0] * along[0] + off[1] * along[1]) / length2).clamp(0.0, 1.0),
            false => 0.0,
        };
        let away = (off[0] - share * along[0]).powi(2) + (off[1] - share * along[1]).powi(2);
        scar.height_mm * (-0.5 * away / scar.half_width_mm.powi(2)).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(edit: impl FnOnce(&mut Patient)) -> Relief {
        let mut p = Patient::load("p01-woman-mean").unwrap();
        edit(&mut p);
        Relief::new(&p, &Outline::new(&p))
    }

    /// Integral over the front of the difference of two reliefs, in millilitres.
    fn between_ml(a: &Relief, b: &Relief) -> f64 {
        const N: i32 = 700;
        let (across, along) = (TAU / f64::from(N), 600.0 / f64::from(N));
        let mut sum = 0.0;
        for i in 0..N {
            for k in 0..N {
                let angle = -PI + across * (f64::from(i) + 0.5);
                let z = -300.0 + along * (f64::from(k) + 0.5);
                sum += (a.at(angle, z) - b.at(angle, z)) * a.chest_mm * across * along;
            }
        }
        sum * 1e-3
    }

    #[test]
    fn breasts_have_the_stated_volume() {
        let without = of(|p| p.chest.breast_ml = [0.0, 1e-9]);
        for volume in [150.0, 500.0] {
            let mut with = of(|p| p.chest.breast_ml = [0.0, volume]);
            // Only the breasts differ. Other features depend on the body's mass, so take them from
            // `without`.
            with.clone_from(&Relief {
                breasts: with.breasts,
                ..without.clone()
            });
            let found = between_ml(&with, &without);
            assert!((found / volume - 1.0).abs() < 0.02, "{found} of {volume}");
        }
    }

    #[test]
    fn scar_has_its_stated_place_and_depth() {
        let scar = Scar {
            from_mm: [20.0, -40.0],
            to_mm: [120.0, 30.0],
            half_width_mm: 5.0,
            height_mm: -3.0,
        };
        let (with, without) = (of(|p| p.scar = Some(scar)), of(|_| {}));
        let off = |q: f64, z: f64| {
            let angle = q / with.chest_mm;
            with.at(angle, z) - without.at(angle, z)
        };
        assert!((off(70.0, -5.0) + 3.0).abs() < 1e-9);
        // 5 mm across the scar's direction.
        let across = 5.0 / 100f64.hypot(70.0);
        let side = off(70.0 - 70.0 * across, -5.0 + 100.0 * across);
        assert!((side + 3.0 * (-0.5f64).exp()).abs() < 1e-9, "{side}");
        assert!(off(-60.0, 100.0).abs() < 1e-9);
    }

    #[test]
    fn around_the_body_there_is_no_seam() {
        let relief = of(|p| p.chest.fold_mm = Some(10.0));
        for i in 0..100 {
            let z = -350.0 + 7.0 * f64::from(i);
            let (left, right) = (relief.at(PI - 1e-9, z), relief.at(-PI + 1e-9, z));
            assert!((left - right).abs() < 1e-6, "{z}: {left} {right}");
        }
    }
}
