//! A Monte Carlo simulation of photons in a half-space: Henyey-Greenstein scattering, a Fresnel
//! boundary, and weights and roulette as in Wang, Jacques, Zheng: "MCML", Computer Methods and
//! Programs in Biomedicine 47 (1995). It does not use diffusion theory.

use phasmid::emulator::render::skin::Tissue;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Mean scattering cosine (anisotropy) of skin (Jacques 2013: 0.7 to 0.95).
const G: f64 = 0.8;
const PHOTONS: u64 = 120_000;
/// Spatial frequencies of the patterns in cycles per millimetre.
const FREQUENCIES: [f64; 5] = [0.05, 0.1, 0.15, 0.2, 0.3];

/// SplitMix64 (Steele, Lea, Flood 2014).
struct Random(u64);

impl Random {
    /// Returns a random number above 0 and below 1.
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (((z ^ (z >> 31)) >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }
}

/// Sums over photons of three quantities: the weight, and the weight times the cosine and times the
/// sine of the phase at which the photon emerges. Also the sums of their squares, from which errors
/// are computed.
#[derive(Clone, Copy, Default)]
struct Tally {
    back: f64,
    back2: f64,
    cos: [f64; 5],
    cos2: [f64; 5],
    sin: [f64; 5],
    sin2: [f64; 5],
}

impl Tally {
    fn add(mut self, other: Self) -> Self {
        self.back += other.back;
        self.back2 += other.back2;
        for i in 0..5 {
            self.cos[i] += other.cos[i];
            self.cos2[i] += other.cos2[i];
            self.sin[i] += other.sin[i];
            self.sin2[i] += other.sin2[i];
        }
        self
    }

    fn emerged(x: f64, weight: f64) -> Self {
        let phase = FREQUENCIES.map(|f| TAU * f * x);
        let (cos, sin) = (
            phase.map(|p| weight * p.cos()),
            phase.map(|p| weight * p.sin()),
        );
        Self {
            back: weight,
            back2: weight * weight,
            cos,
            cos2: cos.map(|c| c * c),
            sin,
            sin2: sin.map(|s| s * s),
        }
    }
}

/// Returns the Fresnel reflectance of unpolarised light from inside, at a cosine to the normal.
fn fresnel(n: f64, cos: f64) -> f64 {
    let sin2 = n * n * (1.0 - cos * cos);
    if sin2 >= 1.0 {
        return 1.0;
    }
    let out = (1.0 - sin2).sqrt();
    let across = (n * cos - out) / (n * cos + out);
    let along = (n * out - cos) / (n * out + cos);
    (across * across + along * along) / 2.0
}

/// Traces one photon that has just entered at the origin and whose direction is tilted along x.
fn photon(tissue: &Tissue, sin: f64, random: &mut Random) -> Tally {
    let scattering = tissue.reduced_scattering_per_mm / (1.0 - G);
    let total = tissue.absorption_per_mm + scattering;
    let (mut x, mut z, mut weight) = (0.0, 0.0, 1.0);
    let mut way = [sin, 0.0, (1.0 - sin * sin).sqrt()];
    loop {
        let mut step = -random.next().ln() / total;
        while z + step * way[2] < 0.0 {
            let up = -z / way[2];
            (x, z, step) = (x + up * way[0], 0.0, step - up);
            if random.next() >= fresnel(tissue.refractive_index, -way[2]) {
                return Tally::emerged(x, weight);
            }
            way[2] = -way[2];
        }
        (x, z) = (x + step * way[0], z + step * way[2]);
        weight *= scattering / total;
        if weight < 1e-2 {
            if random.next() > 0.1 {
                return Tally::default();
            }
            weight *= 10.0;
        }
        way = scattered(way, random);
    }
}

fn scattered([ux, uy, uz]: [f64; 3], random: &mut Random) -> [f64; 3] {
    let t = (1.0 - G * G) / (1.0 - G + 2.0 * G * random.next());
    let cos = (1.0 + G * G - t * t) / (2.0 * G);
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let (sin_turn, cos_turn) = (TAU * random.next()).sin_cos();
    if uz.abs() > 0.999_99 {
        return [sin * cos_turn, sin * sin_turn, cos * uz.signum()];
    }
    let level = (1.0 - uz * uz).sqrt();
    [
        sin * (ux * uz * cos_turn - uy * sin_turn) / level + ux * cos,
        sin * (uy * uz * cos_turn + ux * sin_turn) / level + uy * cos,
        -sin * cos_turn * level + uz * cos,
    ]
}

/// Diffusion theory agrees with the photons within its known accuracy plus four standard errors of
/// their mean. It is inaccurate for patterns that are not much coarser than a scattering length; the
/// tolerances give its error for each frequency.
#[test]
fn reflectance_contrast_and_shift_are_those_of_photons() {
    let tissue = |absorption_per_mm, reduced_scattering_per_mm| Tissue {
        absorption_per_mm,
        reduced_scattering_per_mm,
        refractive_index: 1.4,
    };
    let contrast_bars = [0.02, 0.05, 0.08, 0.10, 0.13];
    let shift_bars = [0.12, 0.12, 0.14, 0.18, 0.30];
    for tissue in [tissue(0.02, 2.0), tissue(0.3, 3.5), tissue(0.005, 1.5)] {
        for degrees in [0.0f64, 45.0] {
            let sin_incident = degrees.to_radians().sin();
            let sin = sin_incident / tissue.refractive_index;
            let sum = (0..PHOTONS)
                .into_par_iter()
                .map(|i| photon(&tissue, sin, &mut Random(i << 32)))
                .reduce(Tally::default, Tally::add);
            let n = PHOTONS as f64;
            let error = |sum: f64, squares: f64| (squares - sum * sum / n).sqrt();
            let r = tissue.reflectance(0.0);
            let found = sum.back / n;
            println!("{tissue:?} {degrees}: R(0) {r:.4}, photons {found:.4}");
            let noise = 4.0 * error(sum.back, sum.back2) / n;
            assert!((r - found).abs() < 0.07 * found + noise, "{r} {found}");
            for i in 0..FREQUENCIES.len() {
                let k = TAU * FREQUENCIES[i];
                let length = sum.cos[i].hypot(sum.sin[i]);
                let (contrast, shift) = (length / sum.back, sum.sin[i].atan2(sum.cos[i]) / k);
                let (theory, lin) = (tissue.transfer(k), tissue.shift_mm(sin_incident));
                println!(
                    "  {} /mm: M {theory:.4}, photons {contrast:.4}; shift {lin:.4}, {shift:.4}",
                    FREQUENCIES[i]
                );
                let noise = 4.0 * error(sum.cos[i], sum.cos2[i]) / sum.back;
                assert!((theory - contrast).abs() < contrast_bars[i] * contrast + noise);
                let noise = 4.0 * error(sum.sin[i], sum.sin2[i]) / (length * k);
                assert!((lin - shift).abs() < shift_bars[i] * lin + noise);
                // The photons' statistical errors are small compared with the tolerances.
                assert!(noise < 0.06 + 0.03 / k, "{noise} mm");
            }
        }
    }
}
