//! One row of pixels through the whole of pass 1, and the choice of instruction set for all row
//! kernels.
//!
//! The bodies are written once, to vectorise; on x86-64 with AVX2 they run compiled for it. No
//! multiplication is fused with an addition in either, so both give the same bits.

use super::borders::{self, Near};
use super::decoder::Verdict;
use super::edges::{self, Around};
use super::gray::{GrayBit, GrayRow, Threshold};
use super::order::{Ensemble, GrayJoin};
use super::phase::{RowNoise, SetKernel, SetRow};
use super::plan::{AxisPlan, Order};
use super::samples::Sample;
use crate::calibrate::{CoordinateRow, Triangulator};
use crate::pattern::Axis;

/// How far beyond the projector's pixels a decoded coordinate may lie, in projector pixels.
const OVERHANG_PX: f32 = 1.0;
/// Stands for a repeat beyond any projector.
const NO_REPEAT: f32 = 1e6;

/// One axis of a plan, in f32.
#[derive(Debug)]
pub(super) struct AxisKernel {
    axis: Axis,
    extent: f32,
    sets: Vec<SetKernel>,
    ensemble: Option<Ensemble>,
    bits: Vec<(GrayBit, Threshold)>,
    join: Option<GrayJoin>,
    wrapped: bool,
}

impl AxisKernel {
    pub(super) fn new(plan: &AxisPlan, references: bool) -> Self {
        let sets: Vec<SetKernel> = plan.sets.iter().map(SetKernel::new).collect();
        let wrapped = matches!(plan.order, Order::Wrapped { .. });
        let repeat = match plan.order {
            Order::Resolved { repeat_px } if repeat_px.is_finite() => repeat_px as f32,
            _ => NO_REPEAT,
        };
        let bits: Vec<_> = plan
            .gray
            .iter()
            .flat_map(|g| g.bits.iter().copied())
            .zip(plan.thresholds.iter().copied())
            .collect();
        let steps = plan.sets.first().map_or(0, |s| s.frames.len());
        let noise_factor = bits
            .iter()
            .map(|(_, t)| t.variance_factor(steps))
            .fold(0.0, f64::max)
            .sqrt() as f32;
        let join = plan.gray.as_ref().map(|g| GrayJoin {
            cell: g.cell_px as f32,
            repeat,
            noise_factor,
        });
        // A lone period with Gray code needs no search among candidates.
        let alone = sets.len() == 1 && join.is_some() && repeat < NO_REPEAT;
        let search = !sets.is_empty() && !wrapped && !alone;
        let ensemble = search.then(|| Ensemble::new(sets.iter().map(|set| set.period).collect()));
        debug_assert!(references || bits.iter().all(|(_, t)| *t != Threshold::Reference));
        Self {
            axis: plan.axis,
            extent: plan.extent_px as f32,
            sets,
            ensemble,
            bits,
            join,
            wrapped,
        }
    }
}

/// What all rows of a decoding share.
pub(super) struct Job<'a, T> {
    pub(super) frames: &'a [&'a [T]],
    pub(super) kernels: &'a [AxisKernel],
    pub(super) references: Option<(usize, usize)>,
    pub(super) noise: RowNoise,
    pub(super) saturation: f32,
    /// From black to saturation.
    pub(super) range: f32,
    pub(super) min_modulation: f32,
    pub(super) max_phase_sigma: f32,
    pub(super) width: usize,
}

/// A worker's buffers, one row long each.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    sets: Vec<SetRow>,
    gray: GrayRow,
    top: Vec<f32>,
    /// Middle of white and black.
    middle: Vec<f32>,
    /// Half of white minus black; without them the modulation.
    half: Vec<f32>,
    /// Standard deviation of a sample at the pixel's mean.
    sigma: Vec<f32>,
    variance: Vec<f32>,
    ok: Vec<bool>,
    candidate: (Vec<f32>, Vec<f32>),
}

/// A row of an axis' maps.
pub(super) struct AxisOut<'a> {
    pub(super) coordinate: &'a mut [f32],
    pub(super) sigma: &'a mut [f32],
    pub(super) verdict: &'a mut [Verdict],
}

/// Defines a function that runs `$body` compiled for AVX2 where the machine has it.
macro_rules! dispatch {
    ($(#[$meta:meta])* $name:ident => $body:path
        [$($generic:ident : $bound:path)?] ($($arg:ident : $type:ty),* $(,)?)) => {
        $(#[$meta])*
        pub(super) fn $name$(<$generic: $bound>)?($($arg: $type),*) {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn fast$(<$generic: $bound>)?($($arg: $type),*) {
                    $body($($arg),*);
                }
                if std::arch::is_x86_feature_detected!("avx2") {
                    #[allow(unsafe_code)]
                    // SAFETY: the machine has just said that it has AVX2, which is all that
                    // `fast` asks for beyond the target's baseline.
                    unsafe {
                        fast($($arg),*);
                    }
                    return;
                }
            }
            $body($($arg),*);
        }
    };
}

dispatch! {
    /// Pass 1 of row `v`.
    decode_row => decode_body [T: Sample] (
        job: &Job<'_, T>,
        v: usize,
        scratch: &mut Scratch,
        outs: [Option<AxisOut<'_>>; 2],
        modulation: &mut [f32],
        intensity: &mut [f32],
    )
}

dispatch! {
    /// Pass 2 of a row: see [`edges::judge_row`].
    judge_row => edges::judge_row [] (around: &Around<'_>, period: f32, flags: &mut [u8])
}

dispatch! {
    /// Pass 2 of a row, once the first flags are applied: see [`borders::judge_row`].
    judge_borders => borders::judge_row [] (near: &Near<'_>, period: f32, flags: &mut [u8])
}

dispatch! {
    /// The second half of pass 2: takes a row's flagged pixels out of a map.
    apply_flags => apply_body [] (out: AxisOut<'_>, flags: &[u8])
}

dispatch! {
    /// Pass 3 of row `v`: see [`Triangulator::row`].
    triangulate_row => Triangulator::row [] (
        triangulator: &Triangulator,
        v: usize,
        x: Option<CoordinateRow<'_>>,
        y: Option<CoordinateRow<'_>>,
        depth: &mut [f32],
        sigma: &mut [f32],
    )
}

fn clear(buffer: &mut Vec<f32>, n: usize) {
    buffer.clear();
    buffer.resize(n, 0.0);
}

#[inline(always)]
fn decode_body<T: Sample>(
    job: &Job<'_, T>,
    v: usize,
    scratch: &mut Scratch,
    outs: [Option<AxisOut<'_>>; 2],
    modulation: &mut [f32],
    intensity: &mut [f32],
) {
    let n = job.width;
    let row = |frame: usize| &job.frames[frame][v * n..(v + 1) * n];
    clear(&mut scratch.middle, n);
    clear(&mut scratch.half, n);
    if let Some((white, black)) = job.references {
        let (white, black) = (row(white), row(black));
        let (middle, half) = (&mut scratch.middle[..n], &mut scratch.half[..n]);
        for i in 0..n {
            let (w, b) = (white[i].dn(), black[i].dn());
            middle[i] = 0.5 * (w + b);
            half[i] = 0.5 * (w - b);
        }
    }
    let mut first = true;
    for (kernel, out) in job.kernels.iter().zip(matched(job.kernels, outs)) {
        axis_row(job, kernel, &row, scratch, out);
        if first {
            first = false;
            match scratch.sets.first() {
                Some(set) if !kernel.sets.is_empty() => modulation.copy_from_slice(&set.modulation),
                _ => modulation.copy_from_slice(&scratch.half),
            }
            let scale = 1.0 / job.range;
            let brightness = if job.references.is_some() {
                &scratch.half[..n]
            } else {
                &modulation[..n]
            };
            for i in 0..n {
                intensity[i] = (2.0 * brightness[i] * scale).clamp(0.0, 1.0);
            }
        }
    }
}

#[inline(always)]
fn apply_body(out: AxisOut<'_>, flags: &[u8]) {
    let n = flags.len();
    let (x, sigma) = (&mut out.coordinate[..n], &mut out.sigma[..n]);
    let verdict = &mut out.verdict[..n];
    for i in 0..n {
        let reason = if flags[i] == edges::MIXED {
            Verdict::Mixed
        } else {
            Verdict::Stray
        };
        let goes = (flags[i] != edges::KEEP) & (verdict[i] as u8 == Verdict::Valid as u8);
        verdict[i] = if goes { reason } else { verdict[i] };
        x[i] = if goes { f32::NAN } else { x[i] };
        sigma[i] = if goes { f32::NAN } else { sigma[i] };
    }
}

/// The outputs in the order of the kernels.
fn matched<'a, 'b>(
    kernels: &'b [AxisKernel],
    mut outs: [Option<AxisOut<'a>>; 2],
) -> impl Iterator<Item = AxisOut<'a>> + use<'a, 'b> {
    kernels.iter().map(move |k| {
        outs[k.axis as usize]
            .take()
            .expect("a map for each axis of the plan")
    })
}

#[inline(always)]
fn axis_row<'f, T: Sample>(
    job: &Job<'_, T>,
    kernel: &AxisKernel,
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
    for (set, k) in scratch.sets.iter_mut().zip(&kernel.sets) {
        set.reset(n);
        for (step, &frame) in k.frames.iter().enumerate() {
            set.add(k, step, row(frame), &mut scratch.top);
        }
        set.finish(k, job.noise);
    }
    gray_row(job, kernel, row, scratch);
    let x = &mut out.coordinate[..n];
    let Scratch {
        sets,
        gray,
        top,
        half,
        sigma,
        variance,
        ok,
        candidate,
        ..
    } = scratch;
    let sets = &sets[..kernel.sets.len()];
    match sets {
        [] => {
            let cell = kernel.join.as_ref().map_or(1.0, |j| j.cell);
            variance.fill(cell * cell / 12.0);
        }
        [set, ..] => {
            x.copy_from_slice(&set.wrapped);
            variance.copy_from_slice(&set.variance);
        }
    }
    if let Some(ensemble) = &kernel.ensemble {
        search(
            job, kernel, ensemble, sets, gray, x, variance, ok, candidate,
        );
    }
    if let Some(join) = &kernel.join {
        if sets.is_empty() {
            join.cells(gray, x, half, sigma, ok);
        } else {
            join.join(gray, x, variance, half, sigma, ok);
        }
    }
    // The verdict, the plainest reason first.
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
    for (set, k) in sets.iter().zip(&kernel.sets) {
        let worst = k.variance_of_phase(job.max_phase_sigma);
        let (b, var) = (&set.modulation[..n], &set.variance[..n]);
        for i in 0..n {
            let dim = (b[i] < job.min_modulation) | (var[i] > worst);
            let was = verdict[i];
            verdict[i] = if dim & (was as u8 != Verdict::Saturated as u8) {
                Verdict::Dim
            } else {
                was
            };
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

/// Reads the Gray bits; sets the half contrast where there is no white and black, and the noise of
/// a sample.
#[inline(always)]
fn gray_row<'f, T: Sample>(
    job: &Job<'_, T>,
    kernel: &AxisKernel,
    row: &impl Fn(usize) -> &'f [T],
    scratch: &mut Scratch,
) {
    if kernel.bits.is_empty() {
        return;
    }
    let n = job.width;
    let Scratch {
        sets,
        gray,
        middle,
        half,
        sigma,
        ..
    } = scratch;
    let set = sets.first().filter(|_| !kernel.sets.is_empty());
    gray.reset(n);
    if job.references.is_none() {
        match set {
            Some(set) => half.copy_from_slice(&set.modulation),
            None => half.fill(0.0),
        }
    }
    for (bit, (frames, threshold)) in kernel.bits.iter().enumerate() {
        match (threshold, frames.plain, frames.inverse) {
            (Threshold::Complement, Some(plain), Some(inverse)) => {
                let (plain, inverse) = (row(plain), row(inverse));
                gray.add_pair(bit, plain, inverse);
                if job.references.is_none() && set.is_none() {
                    // The strongest bit is the contrast, and a pair's mean the threshold.
                    for i in 0..n {
                        let (p, q) = (plain[i].dn(), inverse[i].dn());
                        half[i] = half[i].max(0.5 * (p - q).abs());
                        middle[i] = 0.5 * (p + q);
                    }
                }
            }
            (threshold, plain, inverse) => {
                let level: &[f32] = match (threshold, set) {
                    (Threshold::Fringes, Some(set)) => &set.mean,
                    _ => middle,
                };
                match (plain, inverse) {
                    (Some(frame), _) => gray.add_single(bit, row(frame), level, 1.0),
                    (None, Some(frame)) => gray.add_single(bit, row(frame), level, -1.0),
                    (None, None) => {}
                }
            }
        }
    }
    let mean = set.map_or(&middle[..n], |set| &set.mean[..n]);
    let sigma = &mut sigma[..n];
    for i in 0..n {
        sigma[i] = job.noise.variance(mean[i]).sqrt();
    }
}

/// The search among candidates of several periods, pixel by pixel.
#[allow(clippy::too_many_arguments)]
#[inline(always)]
fn search<T>(
    job: &Job<'_, T>,
    kernel: &AxisKernel,
    ensemble: &Ensemble,
    sets: &[SetRow],
    gray: &GrayRow,
    x: &mut [f32],
    variance: &mut [f32],
    ok: &mut [bool],
    (wrapped, variances): &mut (Vec<f32>, Vec<f32>),
) {
    for i in 0..job.width {
        // Pixels that will be masked for their modulation need no search.
        if sets.iter().any(|s| s.modulation[i] < job.min_modulation) {
            ok[i] = false;
            continue;
        }
        wrapped.clear();
        variances.clear();
        wrapped.extend(sets.iter().map(|s| s.wrapped[i]));
        variances.extend(sets.iter().map(|s| s.variance[i]));
        let (lo, hi) = match &kernel.join {
            Some(join) => {
                // Half a cell to the edges, and a cell beyond them for a bit that is on its edge.
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

#[cfg(test)]
mod tests {
    use super::super::plan::Plan;
    use super::*;
    use crate::geometry::NoiseModel;
    use crate::pattern::Manifest;

    /// Coordinate, sigma, verdict, modulation and intensity of a row.
    type Row = (Vec<u32>, Vec<u32>, Vec<Verdict>, Vec<u32>, Vec<u32>);

    #[test]
    fn both_instruction_sets_give_the_same_bits() {
        let mut text = "[projector]\nwidth_px = 500\nheight_px = 300\n".to_owned();
        for (period, steps) in [(23.7, 5), (31.0, 4)] {
            for i in 0..steps {
                let phase = f64::from(i) * std::f64::consts::TAU / f64::from(steps);
                text += &format!(
                    "[[frame]]\npattern = {{ kind = \"fringe\", axis = \"x\", \
                     period_px = {period}, phase_rad = {phase} }}\n"
                );
            }
        }
        for bit in 0..5 {
            text += &format!(
                "[[frame]]\npattern = {{ kind = \"gray\", axis = \"x\", cell_px = 20, bits = 5, \
                 bit = {bit} }}\n"
            );
        }
        let manifest = Manifest::parse(&text, "t").unwrap();
        let plan = Plan::new(&manifest).unwrap();
        let kernels = [AxisKernel::new(&plan.axes[0], false)];
        let width = 203;
        // Frames of a ramp, and of nothing at all beyond it.
        let frames: Vec<Vec<u8>> = manifest
            .frame
            .iter()
            .map(|f| {
                let level = |u: u32| match f.pattern.level(2 * u) {
                    Some(level) if u < 180 => 30.0 + 160.0 * level,
                    _ => f64::from(u * 7919 % 13),
                };
                (0..width as u32).map(|u| level(u).round() as u8).collect()
            })
            .collect();
        let frames: Vec<&[u8]> = frames.iter().map(Vec::as_slice).collect();
        let noise = NoiseModel {
            gain_dn_per_e: 0.02,
            read_noise_dn: 0.7,
            black_level_dn: 3.0,
            saturation_dn: 255.0,
        };
        let job = Job {
            frames: &frames,
            kernels: &kernels,
            references: None,
            noise: RowNoise::new(&noise),
            saturation: 255.0,
            range: 252.0,
            min_modulation: 2.0,
            max_phase_sigma: 0.15,
            width,
        };
        let run = |dispatched: bool| -> Row {
            let mut maps = [(); 4].map(|()| vec![0.0f32; width]);
            let mut verdict = vec![Verdict::Valid; width];
            let [coordinate, sigma, modulation, intensity] = &mut maps;
            let out = AxisOut {
                coordinate,
                sigma,
                verdict: &mut verdict,
            };
            let (scratch, outs) = (&mut Scratch::default(), [Some(out), None]);
            if dispatched {
                decode_row(&job, 0, scratch, outs, modulation, intensity);
            } else {
                decode_body(&job, 0, scratch, outs, modulation, intensity);
            }
            let [c, s, m, i] = maps.map(|map| map.iter().map(|v| v.to_bits()).collect());
            (c, s, verdict, m, i)
        };
        let (fast, plain) = (run(true), run(false));
        assert!(fast == plain);
        let valid = fast.2.iter().filter(|v| **v == Verdict::Valid).count();
        assert!((150..=180).contains(&valid), "{valid}");
    }
}
