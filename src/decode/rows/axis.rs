//! Decodes one row of one axis: phases and bits to a coordinate, its variance and a verdict.

use super::bits::gray_row;
use super::fringes::SetRow;
use super::job::{AxisKernel, AxisOut, Job, Scratch, clear};
use crate::gray::GrayRow;
use crate::maps::Verdict;
use crate::order::{Ensemble, GrayJoin};
use crate::phase::{Check, SetKernel};
use crate::robust_scale::RobustScale;
use crate::sample::Sample;

/// Maximum distance of a coordinate outside the projector's pixels, in projector pixels.
const OVERHANG_PX: f32 = 1.0;
/// Maximum ratio of the modulation to half of white minus black: a flickering lamp lights the frames
/// differently by about this much.
const ABOVE_WHITE: f32 = 1.5;

#[inline(always)]
pub(super) fn axis_row<'f, T: Sample>(
    job: &Job<'_, T>,
    kernel: &AxisKernel,
    robust_scale: &[RobustScale],
    row: &impl Fn(usize) -> &'f [T],
    scratch: &mut Scratch,
    out: AxisOut<'_>,
) {
    let n = job.width;
    clear(&mut scratch.top, n);
    clear(&mut scratch.sigma, n);
    clear(&mut scratch.variance, n);
    scratch.ok.clear();
    scratch.ok.resize(n, true);
    scratch
        .sets
        .resize_with(kernel.sets.len().max(scratch.sets.len()), SetRow::default);
    let sets = &mut scratch.sets[..kernel.sets.len()];
    for (set, k) in sets.iter_mut().zip(&kernel.sets) {
        set.reset(k, n);
        let top = &mut scratch.top;
        match k.check {
            Check::Own => sum::<T, true>(k, row, set, top),
            _ => sum::<T, false>(k, row, set, top),
        }
    }
    if kernel.sets.iter().any(|k| k.check == Check::Tied) {
        clear(&mut scratch.sum, n);
        tie(kernel, sets, &mut scratch.sum);
    }
    for ((set, k), robust_scale) in sets.iter_mut().zip(&kernel.sets).zip(robust_scale) {
        match k.check {
            Check::None => set.finish::<false>(k, job.noise, robust_scale),
            Check::Own | Check::Tied => set.finish::<true>(k, job.noise, robust_scale),
        }
    }
    gray_row(job, kernel, row, scratch);
    let x = &mut out.coordinate[..n];
    let Scratch {
        sets,
        gray,
        top,
        middle,
        half,
        sigma,
        variance,
        ok,
        candidate,
        ..
    } = scratch;
    let sets = &sets[..kernel.sets.len()];
    let unused = job.unused_bits[kernel.axis as usize];
    let join = kernel.join.map(|join| join.without(unused));
    match sets {
        [] => {
            let cell = join.map_or(1.0, |join| join.cell);
            variance.fill(cell * cell / 12.0);
        }
        [set, ..] => {
            x.copy_from_slice(&set.wrapped);
            variance.copy_from_slice(&set.variance);
        }
    }
    if let Some(ensemble) = &kernel.ensemble {
        search(
            job, kernel, join, ensemble, sets, gray, x, variance, ok, candidate,
        );
    }
    if let Some(join) = join {
        if sets.is_empty() {
            join.cells(gray, x, half, sigma, ok);
        } else {
            join.join(gray, x, variance, half, sigma, ok);
        }
    }
    // The first reason that applies becomes the verdict.
    let (lo, hi) = if kernel.wrapped {
        (f32::NEG_INFINITY, f32::INFINITY)
    } else {
        (-0.5 - OVERHANG_PX, kernel.extent - 0.5 + OVERHANG_PX)
    };
    let (verdict, sd) = (&mut out.verdict[..n], &mut out.sigma[..n]);
    let (top, ok, variance) = (&top[..n], &ok[..n], &variance[..n]);
    for i in 0..n {
        let sure = ok[i] & (x[i] >= lo) & (x[i] <= hi);
        let found = if sure {
            Verdict::Valid
        } else {
            Verdict::Uncertain
        };
        verdict[i] = if top[i] >= job.saturation {
            Verdict::Saturated
        } else {
            found
        };
    }
    for ((set, k), robust_scale) in sets.iter().zip(&kernel.sets).zip(robust_scale) {
        let light = (&middle[..n], &half[..n]);
        match k.check {
            Check::None => judge::<T, false>(job, k, robust_scale, set, light, verdict),
            _ => judge::<T, true>(job, k, robust_scale, set, light, verdict),
        }
    }
    if sets.is_empty() {
        for i in 0..n {
            if half[i] < job.min_modulation {
                verdict[i] = Verdict::Dim;
            }
        }
    }
    for i in 0..n {
        let valid = verdict[i] as u8 == Verdict::Valid as u8;
        x[i] = if valid { x[i] } else { f32::NAN };
        sd[i] = if valid { variance[i].sqrt() } else { f32::NAN };
    }
}

/// Sums over the steps of a set. `OWN` includes the set's own check; sets without one skip its cost.
#[inline(always)]
fn sum<'f, T: Sample, const OWN: bool>(
    k: &SetKernel,
    row: &impl Fn(usize) -> &'f [T],
    set: &mut SetRow,
    top: &mut [f32],
) {
    for (step, &frame) in k.frames.iter().enumerate() {
        set.add::<T, OWN>(k, step, row(frame), top);
    }
    if k.weighs() {
        set.add_higher(k, row);
    }
}

/// Computes the checks of sets that are compared with the other sets of their axis; `all` receives the
/// sum of the sets' means.
#[inline(always)]
fn tie(kernel: &AxisKernel, sets: &mut [SetRow], all: &mut [f32]) {
    let n = all.len();
    for set in sets.iter() {
        for (sum, mean) in all.iter_mut().zip(&set.mean[..n]) {
            *sum += mean;
        }
    }
    for (set, k) in sets.iter_mut().zip(&kernel.sets) {
        if k.check == Check::Tied {
            let (mean, check) = (&set.mean[..n], &mut set.check[..n]);
            for i in 0..n {
                check[i] = k.tied(mean[i], all[i]);
            }
        }
    }
}

/// Updates the verdict from a set: too little modulation, too much noise, steps that contradict each
/// other, or a fringe that exceeds the range from black to white.
#[inline(always)]
fn judge<T, const CHECKED: bool>(
    job: &Job<'_, T>,
    k: &SetKernel,
    robust_scale: &RobustScale,
    set: &SetRow,
    (middle, half): (&[f32], &[f32]),
    verdict: &mut [Verdict],
) {
    let worst = k.variance_of_phase(job.max_phase_sigma);
    let n = verdict.len();
    let (b, var, mean) = (&set.modulation[..n], &set.variance[..n], &set.mean[..n]);
    let has_black = job.references.is_some();
    let check = &set.check[..n];
    let robust_scale = *robust_scale;
    for i in 0..n {
        // White may be clipped where the fringes are not. The distance of their mean from black is
        // then the better reference.
        let black = middle[i] - half[i];
        let light = if has_black { mean[i] - black } else { 0.0 };
        let least = job
            .min_modulation
            .max(job.min_contrast * half[i].max(light));
        let dim = (b[i] < least) | (var[i] > worst);
        let was = verdict[i];
        let light = (mean[i] - job.noise.black).max(0.0);
        // A fringe cannot exceed the range from black to white.
        let odd = (CHECKED && check[i].abs() > robust_scale.most(light, b[i], job.noise))
            | (has_black & (b[i] > ABOVE_WHITE * half[i].max(0.0) + job.min_modulation));
        let lit = match (dim, odd & (was as u8 == Verdict::Valid as u8)) {
            (true, _) => Verdict::Dim,
            (false, true) => Verdict::Odd,
            (false, false) => was,
        };
        verdict[i] = if was as u8 == Verdict::Saturated as u8 {
            was
        } else {
            lit
        };
    }
}

/// Searches among the candidates of several periods, pixel by pixel.
#[allow(clippy::too_many_arguments)]
#[inline(always)]
fn search<T>(
    job: &Job<'_, T>,
    kernel: &AxisKernel,
    join: Option<GrayJoin>,
    ensemble: &Ensemble,
    sets: &[SetRow],
    gray: &GrayRow,
    x: &mut [f32],
    variance: &mut [f32],
    ok: &mut [bool],
    (wrapped, variances): &mut (Vec<f32>, Vec<f32>),
) {
    let sets_with = || sets.iter().zip(&kernel.sets);
    let worst = |k: &SetKernel| k.variance_of_phase(job.max_phase_sigma);
    for i in 0..job.width {
        // Pixels that are rejected for their modulation or noise need no search.
        let dim = |(set, k): (&SetRow, &SetKernel)| {
            set.modulation[i] < job.min_modulation || set.variance[i] > worst(k)
        };
        if sets_with().any(dim) {
            ok[i] = false;
            continue;
        }
        wrapped.clear();
        variances.clear();
        wrapped.extend(sets.iter().map(|s| s.wrapped[i]));
        variances.extend(sets.iter().map(|s| s.variance[i]));
        let (lo, hi) = match join {
            Some(join) => {
                // Half a cell to either edge, plus one cell for a pixel that lies on a bit's edge.
                let reach = (0.5 * join.repeat).min(1.5 * join.cell);
                let center = join.center(gray.code[i]);
                (center - reach, center + reach)
            }
            None => (-0.5 - OVERHANG_PX, kernel.extent - 0.5 + OVERHANG_PX),
        };
        let found = ensemble.best(wrapped, variances, lo, hi);
        x[i] = found.x;
        variance[i] = found.variance;
        ok[i] = found.certain;
    }
}
