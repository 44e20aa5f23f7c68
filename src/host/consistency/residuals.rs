//! How many pixels' steps contradict each other by more than noise.
//!
//! Four or more steps of one set leave a residual. In a sound capture it is noise, and what is the
//! same everywhere in units of the fringes: a lamp that flickers leaves a part of the light and of
//! the fringe itself, a response curve the second harmonic. Those are fitted to the capture and taken
//! off; the noise is what the middle one of the pixels of about one mean has, since most pixels of a
//! damaged capture are sound. Bits that are flipped, rows that have moved up and frames that are torn
//! leave pixels beyond [`SIGMAS`] of it and of the model error, of which noise makes 6 in 100,000.
//!
//! No sound capture of `tests/host/consistency.rs` has more than [`SHARE`] of them: the middles of three
//! built-in profiles' cameras before sphere, torso and couch, in light of a tenth to twice the usual, with
//! ambient light, and by response curves of 0.6 to 2.2. A row
//! that a fringe frame lacks is found where surfaces differ from row to row by as much as would move
//! points by 1 mm in 0.1 % of the pixels; of flipped bits, a few hundred in an image of 25,000 pixels.
//! Fewer pixels are left to the decoder, which refuses each whose residual is beyond the same bound.

use super::noise::Noise;
use super::scatter::Scatter;
use nalgebra::{SMatrix, SVector};
use phasmid_decode::{FringeSet, MODEL_ERROR};
use rayon::prelude::*;

/// Pixels times steps that are looked at, about.
const POINTS: usize = 60_000;
/// Every so many'th point makes the fit.
const FITTED: usize = 4;
/// Deviations beyond which a residual is hardly noise.
const SIGMAS: f64 = 4.0;
/// Part of the pixels that may have such residuals,
const SHARE: f64 = 5e-4;
/// and how many at least.
const LEAST: usize = 8;
/// Fewest pixels that tell their noise.
pub(super) const FEWEST: usize = 400;
/// Least modulation in DN.
pub(super) const LEAST_DN: f64 = 2.0;
/// Part of the harmonics that blur may take away, or leave, in some part of the image.
const BLURRED: f64 = 0.75;
/// Rounds of the robust fit.
const ROUNDS: usize = 3;
/// Steps up to which all residuals are one.
const ONE: usize = 4;
/// What is the same everywhere: the light, both parts of the fringe, of its second and of its third
/// harmonic.
const TERMS: usize = 7;

/// A pixel with fringes: its mean, both parts of its fringe, its terms and the residual of each step.
pub(super) struct Pixel {
    solved: [f64; 3],
    terms: SVector<f64, TERMS>,
    residuals: Vec<f64>,
}

impl Pixel {
    /// Of a mean, of which `light` is above black, both parts of its fringe, and what is left of its
    /// steps.
    pub(super) fn new(solved: [f64; 3], light: f64, residuals: Vec<f64>) -> Self {
        let [_, c, s] = solved;
        let b = c.hypot(s).max(1e-9);
        let (cos, sin) = (c / b, s / b);
        let (second, third) = (2.0 * cos * cos - 1.0, 4.0 * cos * cos - 3.0);
        let terms = [
            light,
            c,
            s,
            b * second,
            b * 2.0 * cos * sin,
            b * third * cos,
            b * (third + 2.0) * sin,
        ];
        Self {
            solved,
            terms: terms.into(),
            residuals,
        }
    }
}

/// What is left of pixels without the usual.
pub(super) struct Left {
    /// Pixels whose residual is no noise.
    pub(super) odd: usize,
    /// Deviation of most of the middle pixel's like, in DN.
    pub(super) deviation_dn: f64,
}

/// A pixel in one step.
#[derive(Clone, Copy)]
struct Point<'a> {
    /// Mean light in DN that makes as much noise.
    light: f64,
    terms: &'a SVector<f64, TERMS>,
    residual: f64,
    /// What is left without the usual.
    left: f64,
}

/// Whether too many pixels' steps of a set contradict each other.
pub(super) fn check(
    set: &FringeSet,
    black: Option<usize>,
    scatter: &Scatter,
) -> Result<(), String> {
    let n = set.frames.len();
    if n < 4 {
        return Ok(());
    }
    let steps = if n == ONE { 1 } else { n };
    let stride = (scatter.len() * steps).div_ceil(POINTS).max(1);
    let pixels = pixels(set, black, scatter, stride);
    if pixels.len() < FEWEST {
        return Ok(());
    }
    let worst = (0..steps)
        .into_par_iter()
        .map(|k| (k, left(&pixels, noisy(set, k), k).odd))
        .max_by_key(|(_, odd)| *odd);
    let Some((step, odd)) = worst else {
        return Ok(());
    };
    let share = odd as f64 / pixels.len() as f64;
    if odd < LEAST || share <= SHARE {
        return Ok(());
    }
    let (first, last) = (set.frames[0], set.frames[n - 1]);
    let which = match steps {
        1 => String::new(),
        _ => format!(", frame {} the most", set.frames[step]),
    };
    Err(format!(
        "frames {first} to {last} contradict each other in {:.2} % of the pixels{which}: rows or bits \
         of one are damaged, or something moved",
        100.0 * share
    ))
}

fn pixels(set: &FringeSet, black: Option<usize>, scatter: &Scatter, stride: usize) -> Vec<Pixel> {
    let turns: Vec<(f64, f64)> = set.phases.iter().map(|t| (t.cos(), t.sin())).collect();
    let mut all = Vec::new();
    for values in scatter.pixels().step_by(stride) {
        let samples: Vec<f64> = set.frames.iter().map(|f| f64::from(values[*f])).collect();
        let [a, c, s] = set.solve(&samples);
        if c.hypot(s) < LEAST_DN {
            continue;
        }
        let light = a - black.map_or(0.0, |black| f64::from(values[black]));
        let fitted = turns.iter().map(|(cos, sin)| a + c * cos - s * sin);
        let residuals = samples.iter().zip(fitted).map(|(v, f)| v - f).collect();
        all.push(Pixel::new([a, c, s], light, residuals));
    }
    all
}

/// Weights of the mean and both parts of the fringe in the light that makes a step's residual noisy:
/// the residual is P v, so the variance of step k is that of a sample at sum P_kj^2 v_j / P_kk, times
/// P_kk.
fn noisy(set: &FringeSet, step: usize) -> [f64; 3] {
    let row = |k: usize| [1.0, set.phases[k].cos(), -set.phases[k].sin()];
    let of = |w: &[f64; 3], r: &[f64; 3]| w[0] * r[0] + w[1] * r[1] + w[2] * r[2];
    let mut sums = [0.0; 3];
    let mut all = 0.0;
    for j in 0..set.phases.len() {
        let own = if j == step { 1.0 } else { 0.0 };
        let square = (own - of(&set.weights[j], &row(step))).powi(2);
        all += square;
        for (sum, part) in sums.iter_mut().zip(row(j)) {
            *sum += square * part;
        }
    }
    sums.map(|sum| sum / all.max(1e-12))
}

/// What is left of a residual of pixels; `weights` are those of the mean and both parts of the fringe in
/// the light that makes it noisy.
pub(super) fn left(pixels: &[Pixel], weights: [f64; 3], step: usize) -> Left {
    let mut points: Vec<Point<'_>> = pixels
        .iter()
        .map(|pixel| Point {
            light: weights.iter().zip(pixel.solved).map(|(w, v)| w * v).sum(),
            terms: &pixel.terms,
            residual: pixel.residuals[step],
            left: pixel.residuals[step],
        })
        .collect();
    points.sort_by(|a, b| a.light.total_cmp(&b.light));
    let lefts = |points: &[Point<'_>]| -> Vec<(f64, f64)> {
        points.iter().map(|p| (p.light, p.left)).collect()
    };
    let mut deviations = Noise::of(&lefts(&points)).each();
    let mut harmonics = 0.0;
    for _ in 0..ROUNDS {
        let Some(usual) = fit(&points, &deviations) else {
            break;
        };
        for point in &mut points {
            point.left = point.residual - usual.dot(point.terms);
        }
        harmonics = usual.rows(3, 4).norm();
        deviations = Noise::of(&lefts(&points)).each();
    }
    let beyond = |(point, deviation): &(&Point<'_>, &f64)| {
        let modulation = point.terms[1].hypot(point.terms[2]);
        let expected = deviation.hypot(MODEL_ERROR * modulation);
        point.left.abs() > SIGMAS * expected + BLURRED * harmonics * modulation
    };
    let odd = points.iter().zip(&deviations).filter(beyond).count();
    deviations.sort_by(f64::total_cmp);
    Left {
        odd,
        deviation_dn: deviations.get(deviations.len() / 2).copied().unwrap_or(0.0),
    }
}

/// The terms of the residual that is usual; points far from it by the last round's count less.
fn fit(points: &[Point<'_>], deviations: &[f64]) -> Option<SVector<f64, TERMS>> {
    let mut normal = SMatrix::<f64, TERMS, TERMS>::zeros();
    let mut right = SVector::<f64, TERMS>::zeros();
    for (point, deviation) in points.iter().zip(deviations).step_by(FITTED) {
        let distance = point.left.abs().max(1e-9);
        let weight = (2.0 * deviation / distance).min(1.0) / (deviation * deviation);
        normal += point.terms * point.terms.transpose() * weight;
        right += point.terms * (point.residual * weight);
    }
    normal.cholesky().map(|c| c.solve(&right))
}
