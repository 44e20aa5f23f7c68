//! Fringes that are not sinusoidal.
//!
//! N equal steps alias harmonics of order N - 1 and N + 1 to the fringe itself: the phase is off by
//! `e = a cos(N phi) + b sin(N phi)`. If the two harmonics differ in strength, the modulation follows
//! N phi too.
//!
//! - Along a surface the phase grows by about the same w from each pixel to the next, so its second
//!   difference shows the error: `e(phi + w) - 2 e(phi) + e(phi - w) = -2 (1 - cos(N w)) e(phi)`.
//!   This is linear in a and b, which are fitted to all pixels by least squares. Curved surfaces,
//!   texture and noise also have second differences, but these do not follow the phase. Coarse fringes
//!   change too little from pixel to pixel to show the error.
//! - With white and black, the modulation relative to half their contrast is compared with the phase.
//!
//! Three steps alias the second harmonic to the fringe. Every nonlinear response curve has a second
//! harmonic, so this error is a property of the device: it is reported and nothing is rejected. With
//! four or more steps no response curve causes an error of that size; a possible cause is an exposure
//! that does not cover all bit planes of a DMD.

use super::FrameDoubt;
use super::pixels::Line;
use super::sample::Sample;
use crate::FringeSet;
use nalgebra::{Complex, Matrix2, Matrix3, Vector2, Vector3};
use rayon::prelude::*;
use std::f32::consts::{PI, TAU};

/// Maximum phase error in radians that a response curve explains with four or more steps: with four
/// steps, a projector of gamma 0.6 causes 0.06, and a projector of gamma 2.2 causes 0.01.
const LARGEST_RAD: f64 = 0.08;
/// Maximum phase error in radians that a response curve explains with three steps: gamma 2.2 gives
/// 0.29.
const BELIEVED_RAD: f64 = 0.35;
/// A phase error above [`LARGEST_RAD`] is rejected only for sets of at least this many steps.
const REFUSED_STEPS: usize = 4;
/// Maximum phase error in radians that is not reported; for a period of 16 px it is 0.05 px.
const WORTH_RAD: f64 = 0.02;
/// Number of standard errors by which a phase error must exceed [`WORTH_RAD`] or [`LARGEST_RAD`].
const SIGMAS: f64 = 4.0;
/// Number of rows and of columns that are examined.
const LINES: usize = 16;
/// Minimum number of pixels for an estimate from second differences of the phase.
const FEWEST: usize = 500;
/// Minimum number of pixels for an estimate from the modulation.
const FEWEST_MODULATED: usize = 1000;
/// Maximum number of pixels that are used for the estimate from the modulation.
const MODULATED: usize = 5000;
/// Minimum modulation in DN.
const LEAST_DN: f64 = 3.0;
/// Minimum modulation in standard deviations of the noise.
const LEAST_SIGMAS: f64 = 4.0;
/// Minimum contrast of white and black in standard deviations of the noise.
const CONTRAST: f32 = 10.0;
/// Minimum contrast of white and black in DN: below it, rounding errors follow the phase.
const CONTRAST_DN: f32 = 12.0;
/// Allowed modulation of the pixels that are used, relative to the median pixel: blur lowers the
/// modulation, and larger values are implausible.
const USUAL: std::ops::Range<f64> = 0.5..2.0;
/// Maximum phase change between neighbouring pixels, and maximum difference of two successive changes,
/// in radians. Larger values are treated as edges.
const MOST_RAD: (f32, f32) = (1.5, 1.0);
/// Minimum mean square, over all pixels, of the factor by which second differences show the error.
const LEAST_SHOWN: f64 = 0.1;

/// A set whose fringes are not sinusoidal.
pub(super) struct Bent {
    frames: [usize; 2],
    steps: usize,
    /// Amplitude of the phase error in radians.
    error_rad: f64,
    /// Lower bound of the amplitude: `error_rad` minus an allowance for noise.
    least_rad: f64,
}

impl Bent {
    /// Whether a response curve can cause this error. Such an error makes fringe orders uncertain.
    pub(super) fn is_believed(&self) -> bool {
        self.steps < REFUSED_STEPS && self.error_rad < BELIEVED_RAD
    }

    /// Whether no response curve can cause this error.
    pub(super) fn is_refused(&self) -> bool {
        self.steps >= REFUSED_STEPS && self.least_rad > LARGEST_RAD
    }

    pub(super) fn doubt(&self) -> FrameDoubt {
        FrameDoubt::NotSinusoidal {
            frames: self.frames[0]..=self.frames[1],
            phase_error_rad: self.error_rad,
        }
    }
}

/// Returns the sets of a capture whose phase error is large enough to report.
pub(super) fn of_capture(sample: &Sample) -> Vec<Bent> {
    let sets = sample.plan.axes.iter().flat_map(|axis| &axis.sets);
    let bent = |set: &FringeSet| {
        if !set.steps_are_equal() {
            return None;
        }
        let by_phase = phase_error(set, sample);
        let by_phase = by_phase.map(|(error, deviation)| (error, error - SIGMAS * deviation));
        let by_phase = by_phase.filter(|(_, least)| *least > WORTH_RAD);
        let refused = set.frames.len() >= REFUSED_STEPS;
        let ripple = refused.then(|| ripple(set, sample)).flatten();
        let by_modulation = ripple.filter(|r| *r > LARGEST_RAD).map(|r| (r, r));
        let (error_rad, least_rad) = by_modulation
            .into_iter()
            .chain(by_phase)
            .max_by(|a, b| a.1.total_cmp(&b.1))?;
        let ends = [set.frames.iter().min()?, set.frames.iter().max()?];
        Some(Bent {
            frames: ends.map(|frame| *frame),
            steps: set.frames.len(),
            error_rad,
            least_rad,
        })
    };
    sets.filter_map(bent).collect()
}

/// Returns the amplitude of the phase error and its standard deviation, in radians, from rows and
/// columns along which the phase changes enough to show the error; `None` if these have too few pixels.
fn phase_error(set: &FringeSet, sample: &Sample) -> Option<(f64, f64)> {
    let lines = [true, false].map(|rows| along_lines(set, sample, rows));
    let shown = lines.into_iter().filter(Sums::is_shown);
    let all = shown.fold(Sums::default(), Sums::and);
    if all.pixels < FEWEST {
        return None;
    }
    let inverse = all.normal.try_inverse()?;
    let error = inverse * all.right;
    let variance = (all.square - error.dot(&all.right)).max(0.0) / all.pixels as f64;
    let most = inverse.symmetric_eigenvalues().max();
    Some((error.norm(), (variance * most).sqrt()))
}

/// Returns the sums over some rows, or over some columns if `rows` is false.
fn along_lines(set: &FringeSet, sample: &Sample, rows: bool) -> Sums {
    let pixels = if rows { &sample.rows } else { &sample.columns };
    let Some(fringes) = pixels.fringes(set) else {
        return Sums::default();
    };
    let saturated = pixels.saturated_in(set.frames.iter().copied());
    let least = LEAST_DN.max(LEAST_SIGMAS * sample.usual_noise_dn()) as f32;
    let n = set.phases.len() as f32;
    let phase = |pixel: usize| {
        let [c, s] = fringes.at(pixel);
        let is_lit = c * c + s * s >= least * least && !saturated[pixel];
        is_lit.then(|| s.atan2(c))
    };
    let of_line = |line: &Line| {
        let phases: Vec<Option<f32>> = line.pixels().map(phase).collect();
        let mut sums = Sums::default();
        for three in phases.windows(3) {
            if let &[Some(before), Some(here), Some(after)] = three {
                sums.add([before, here, after], n);
            }
        }
        sums
    };
    let lines = pixels.lines(rows, LINES);
    let of_lines: Vec<Sums> = lines.par_iter().map(of_line).collect();
    of_lines.into_iter().fold(Sums::default(), Sums::and)
}

/// Sums of the normal equations for a and b, from second differences of the phase.
#[derive(Default)]
struct Sums {
    normal: Matrix2<f64>,
    right: Vector2<f64>,
    /// Sum of squares of the factors by which second differences show the error.
    shown: f64,
    /// Sum of squares of the second differences.
    square: f64,
    pixels: usize,
}

impl Sums {
    /// Adds the phases of three neighbouring pixels on a surface, measured with `n` steps.
    fn add(&mut self, [before, here, after]: [f32; 3], n: f32) {
        let (rise, next) = (wrapped(here - before), wrapped(after - here));
        let grows = 0.5 * (rise + next);
        if grows.abs() > MOST_RAD.0 || (next - rise).abs() > MOST_RAD.1 {
            return;
        }
        let left = f64::from(-2.0 * (1.0 - (n * grows).cos()));
        let (sin, cos) = (n * here).sin_cos();
        let row = left * Vector2::new(cos, sin).cast::<f64>();
        let difference = f64::from(next - rise);
        self.normal += row * row.transpose();
        self.right += row * difference;
        self.shown += left * left;
        self.square += difference * difference;
        self.pixels += 1;
    }

    /// Whether second differences are large enough to show the error.
    fn is_shown(&self) -> bool {
        self.shown >= LEAST_SHOWN * self.pixels as f64
    }

    fn and(self, other: Self) -> Self {
        Self {
            normal: self.normal + other.normal,
            right: self.right + other.right,
            shown: self.shown + other.shown,
            square: self.square + other.square,
            pixels: self.pixels + other.pixels,
        }
    }
}

/// Returns the amplitude with which the modulation follows N times the phase, relative to its mean.
fn ripple(set: &FringeSet, sample: &Sample) -> Option<f64> {
    let (white, black) = sample.plan.references()?;
    let n = set.phases.len() as u32;
    let pixels = &sample.columns;
    let [white, black] = [white, black].map(|frame| pixels.frame(frame));
    let fringes = pixels.fringes(set)?;
    let is_bright = |i: &usize| {
        let least = CONTRAST_DN.max(CONTRAST * sample.noise_dn[*i]);
        !pixels.is_saturated(*i) && white[*i] - black[*i] >= least
    };
    let bright: Vec<usize> = (0..pixels.len()).filter(is_bright).collect();
    if bright.len() < FEWEST_MODULATED {
        return None;
    }
    // Returns the modulation relative to half the contrast, and the unit phasor of the fringe.
    let told = |i: &usize| {
        let [c, s] = fringes.at(*i).map(f64::from);
        let modulation = (c * c + s * s).sqrt();
        let fringe = Complex::new(c, s) / modulation.max(f64::MIN_POSITIVE);
        (2.0 * modulation / f64::from(white[*i] - black[*i]), fringe)
    };
    // Equal steps would take the same few columns of every row, so each pixel is at another place of its
    // stretch.
    let count = bright.len().min(MODULATED);
    let stretch = bright.len() as f64 / count as f64;
    let place = |k: usize| ((k as f64 + (k as f64 * 0.618_033_988_75).fract()) * stretch) as usize;
    let some = (0..count).filter_map(|k| bright.get(place(k)));
    let mut told: Vec<(f64, Complex<f64>)> = some.map(told).collect();
    let middle = told.len() / 2;
    let by_modulation = |a: &(f64, _), b: &(f64, _)| a.0.total_cmp(&b.0);
    let usual = told.select_nth_unstable_by(middle, by_modulation).1.0;
    told.retain(|(modulation, _)| USUAL.contains(&(modulation / usual)));
    let mut normal = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for (modulation, fringe) in told {
        let turns = fringe.powu(n);
        let row = Vector3::new(1.0, turns.re, turns.im);
        normal += row * row.transpose();
        right += row * modulation;
    }
    let fitted = normal.try_inverse()? * right;
    Some(fitted[1].hypot(fitted[2]) / fitted[0])
}

/// Reduces a difference of two angles, each between -pi and pi, to that range.
fn wrapped(difference: f32) -> f32 {
    if difference < -PI {
        difference + TAU
    } else if difference > PI {
        difference - TAU
    } else {
        difference
    }
}
