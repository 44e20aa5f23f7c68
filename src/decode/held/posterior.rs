//! The true coordinate given a decoded one: mean and variance over all true coordinates. They are
//! equally likely a priori, and each is observed with its error ([`Curve`]) and noise.

use super::curve::{Curve, Footprint, POINTS, at};
use std::iter::repeat_with;
use std::sync::OnceLock;

/// Number of intervals per projector pixel into which decoded coordinates are divided.
const BINS: usize = 64;
/// Spacing of the table's footprints in projector pixels; the curves in between are interpolated.
const WIDTH_STEP: f32 = 0.05;
/// Largest footprint in projector pixels. Beyond it the error is below 0.012 px (rms).
const WIDEST: f32 = 6.0;
const WIDTHS: usize = 121;
/// The table's blurs in projector pixels; with the last one the error vanishes.
const BLURS: [f32; 9] = [0.0, 0.06, 0.12, 0.18, 0.25, 0.32, 0.4, 0.52, 0.7];
/// Minimum standard deviation of noise and model error together, in projector pixels. A smaller one
/// would decide between true coordinates by differences below the accuracy of the footprint's model.
const LEAST_SIGMA: f32 = 0.004;
/// Ratio of successive noise levels in the table; the nearest level is used.
const SIGMA_RATIO: f32 = 1.2;
const SIGMAS: usize = 24;
/// An error below this fraction of the noise is left out: it adds 0.5 % to the standard deviation.
pub(super) const NEGLIGIBLE: f32 = 0.1;
/// Distance, in standard deviations of noise, beyond which a true coordinate is ruled out.
const REACH: f32 = 5.0;

/// Correction and its uncertainty over one projector pixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Profile {
    /// True minus decoded coordinate in projector pixels, tabulated over the decoded coordinate modulo
    /// one pixel.
    shift: [f32; BINS + 1],
    /// Variance of the true coordinate in square projector pixels, noise included.
    variance: [f32; BINS + 1],
    /// Standard deviation of the noise in projector pixels, without the model error that `variance`
    /// contains.
    sigma: f32,
}

impl Profile {
    fn new(curve: &Curve, sigma: f32) -> Self {
        let step = 1.0 / POINTS as f32;
        let error = |i: i32| curve.error[i.rem_euclid(POINTS as i32) as usize];
        // The decoded coordinate at the middle of each interval of true coordinates, and the variance
        // of its observation: the noise plus the spread within the interval.
        let pieces: Vec<_> = (0..POINTS as i32)
            .map(|i| {
                let (a, b) = (error(i), error(i + 1));
                let spread = step + b - a;
                let variance = sigma * sigma + spread * spread / 12.0;
                (0.5 * (a + b), variance.recip())
            })
            .collect();
        let (mut shift, mut variance) = ([0.0; BINS + 1], [0.0; BINS + 1]);
        for bin in 0..=BINS / 2 {
            let decoded = bin as f32 / BINS as f32;
            // The error is at most half a pixel.
            let reach = ((0.5 + REACH * sigma) * POINTS as f32).ceil() as i32;
            let middle = (decoded * POINTS as f32) as i32;
            let (mut sum, mut first, mut second) = (0.0, 0.0, 0.0);
            for i in middle - reach..=middle + reach {
                let (e, precision) = pieces[i.rem_euclid(POINTS as i32) as usize];
                let from = (i as f32 + 0.5) * step - decoded;
                let miss = (from + e) * (from + e) * precision;
                if miss < REACH * REACH {
                    let weight = (-0.5 * miss).exp() * precision.sqrt();
                    sum += weight;
                    first += weight * from;
                    second += weight * from * from;
                }
            }
            // Every decoded coordinate lies in the range of x + e(x), so that the sum is positive.
            let mean = first / sum;
            let spread = (second / sum - mean * mean).max(0.0);
            (shift[bin], shift[BINS - bin]) = (mean, -mean);
            (variance[bin], variance[BINS - bin]) = (spread, spread);
        }
        // The shift is 0 at the centre of a pixel and at its edge, by symmetry.
        (shift[0], shift[BINS / 2], shift[BINS]) = (0.0, 0.0, 0.0);
        Self {
            shift,
            variance,
            sigma,
        }
    }

    /// Returns the estimate of the true coordinate for a decoded one.
    #[inline(always)]
    pub(super) fn at(&self, decoded: f32) -> Estimate {
        let place = (decoded - decoded.floor()) * BINS as f32;
        let bin = (place as usize).min(BINS - 1);
        let share = place - bin as f32;
        let change = |values: &[f32; BINS + 1]| values[bin + 1] - values[bin];
        let gain = (1.0 + change(&self.shift) * BINS as f32).max(0.0);
        let variance = self.variance[bin] + share * change(&self.variance);
        let of_noise = gain * self.sigma;
        Estimate {
            shift: self.shift[bin] + share * change(&self.shift),
            gain,
            beyond_noise: (variance - of_noise * of_noise).max(0.0).sqrt(),
        }
    }
}

/// An estimate of a true coordinate.
#[derive(Debug, Clone, Copy)]
pub(super) struct Estimate {
    /// True minus decoded coordinate in projector pixels.
    pub(super) shift: f32,
    /// Derivative of the estimate with respect to the decoded coordinate, whose noise it multiplies.
    pub(super) gain: f32,
    /// Standard deviation of the true coordinate in projector pixels, without the contribution of
    /// noise.
    pub(super) beyond_noise: f32,
}

/// Curves and profiles of a period, each computed when it is first needed.
#[derive(Debug)]
pub struct Table {
    period: f64,
    /// RMS error of coordinates due to the rounding of the pattern's levels, in projector pixels.
    pub(super) rounding: f32,
    curves: Vec<OnceLock<Box<Curve>>>,
    profiles: Vec<OnceLock<Box<Profile>>>,
}

/// A position between two entries of a table: index of the first, and weight of the second.
type Between = (usize, f32);

impl Table {
    /// Prepares the table of a period and the error due to rounding, in projector pixels.
    pub fn new(period: f64, rounding: f32) -> Self {
        let curves = WIDTHS * BLURS.len();
        Self {
            period,
            rounding,
            curves: repeat_with(OnceLock::new).take(curves).collect(),
            profiles: repeat_with(OnceLock::new).take(curves * SIGMAS).collect(),
        }
    }

    /// Returns the error of a footprint without blur as a function of the true coordinate, in
    /// projector pixels.
    pub(super) fn sharp(&self, width: f32) -> impl Fn(f32) -> f32 {
        let is_known = width <= WIDEST;
        let curves = corners(at_width(width)).map(|(w, by)| (self.curve(w, 0), by));
        move |x| {
            let each = curves.iter().map(|(curve, by)| by * at(&curve.error, x).0);
            if is_known { each.sum() } else { 0.0 }
        }
    }

    /// Returns a property of the curve of a footprint.
    pub(super) fn of(&self, footprint: Footprint, property: impl Fn(&Curve) -> f32) -> f32 {
        if footprint.width > WIDEST {
            return 0.0;
        }
        let [w, s] = [at_width(footprint.width), at_blur(footprint.blur)].map(corners);
        let each = |(w, by)| s.map(|(s, of)| by * of * property(self.curve(w, s)));
        w.into_iter().flat_map(each).sum()
    }

    /// Returns the error of a footprint at x = 0, 1 / `POINTS`, ... 1, in projector pixels.
    pub(super) fn error(&self, footprint: Footprint) -> [f32; POINTS + 1] {
        let mut all = [0.0; POINTS + 1];
        if footprint.width > WIDEST {
            return all;
        }
        for (w, by) in corners(at_width(footprint.width)) {
            for (s, of) in corners(at_blur(footprint.blur)) {
                for (all, one) in all.iter_mut().zip(&self.curve(w, s).error) {
                    *all += by * of * one;
                }
            }
        }
        all
    }

    /// Returns the profile of a footprint, with noise in projector pixels.
    #[inline(always)]
    pub(super) fn profile(&self, footprint: Footprint, sigma: f32) -> Profile {
        let (w, s) = (at_width(footprint.width), at_blur(footprint.blur));
        let both = sigma.hypot(self.rounding).max(LEAST_SIGMA);
        let n = (both / LEAST_SIGMA).ln() / SIGMA_RATIO.ln();
        let n = (n.round() as usize).min(SIGMAS - 1);
        let mut all = Profile {
            shift: [0.0; BINS + 1],
            variance: [0.0; BINS + 1],
            sigma: LEAST_SIGMA * SIGMA_RATIO.powi(n as i32) * sigma / both,
        };
        for (w, by) in corners(w) {
            for (s, of) in corners(s) {
                let weight = by * of;
                if weight == 0.0 {
                    continue;
                }
                let one = self.entry(w, s, n);
                for i in 0..=BINS / 2 {
                    all.shift[i] += weight * one.shift[i];
                    all.variance[i] += weight * one.variance[i];
                }
            }
        }
        for i in 0..BINS / 2 {
            all.shift[BINS - i] = -all.shift[i];
            all.variance[BINS - i] = all.variance[i];
        }
        all
    }

    fn curve(&self, w: usize, s: usize) -> &Curve {
        self.curves[w * BLURS.len() + s]
            .get_or_init(|| Box::new(Curve::new(self.period, width_of(w), f64::from(BLURS[s]))))
    }

    fn entry(&self, w: usize, s: usize, n: usize) -> &Profile {
        self.profiles[(w * BLURS.len() + s) * SIGMAS + n].get_or_init(|| {
            let sigma = LEAST_SIGMA * SIGMA_RATIO.powi(n as i32);
            Box::new(Profile::new(self.curve(w, s), sigma))
        })
    }
}

fn width_of(w: usize) -> f64 {
    f64::from(w.max(1) as f32 * WIDTH_STEP)
}

fn at_width(width: f32) -> Between {
    between(width.min(WIDEST) / WIDTH_STEP, WIDTHS)
}

fn at_blur(blur: f32) -> Between {
    let next = BLURS.iter().position(|b| *b > blur);
    match next {
        None | Some(0) => (BLURS.len() - 2, 1.0),
        Some(next) => {
            let [a, b] = [BLURS[next - 1], BLURS[next]];
            (next - 1, (blur - a) / (b - a))
        }
    }
}

fn between(place: f32, entries: usize) -> Between {
    let first = (place as usize).min(entries - 2);
    (first, place - first as f32)
}

/// Returns the indices of the two entries, each with its weight.
fn corners((first, share): Between) -> [(usize, f32); 2] {
    [(first, 1.0 - share), (first + 1, share)]
}
