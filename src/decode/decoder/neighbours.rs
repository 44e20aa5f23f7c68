//! Pass 2: flags pixels that disagree with their neighbours, then removes them from the maps.

use crate::borders::{LightNoise, Near};
use crate::edges::{Around, KEEP};
use crate::held::Footprints;
use crate::maps::{AxisMap, Decoded};
use crate::rows::{AxisOut, BAND, apply_flags, judge_borders, judge_row};
use rayon::prelude::*;

/// The finest fringes of an axis.
#[derive(Clone, Copy)]
pub(super) struct Finest {
    /// Period in projector pixels times the spacing of the decoded pixels; infinite without fringes.
    pub(super) period: f32,
    /// Variance of the coordinate due to model errors of the samples (rounded levels), in projector
    /// pixels^2.
    pub(super) model: f32,
}

/// Removes mixed and isolated pixels, then border pixels that are not trusted.
///
/// `finest` and `held` are per axis, x first; `held` contains the footprints of axes on which held
/// projector pixels matter.
pub(super) fn clean(
    out: &mut Decoded,
    light: LightNoise,
    finest: [Finest; 2],
    held: &[Option<Footprints<'_>>; 2],
) {
    let mut flags = vec![KEEP; out.width * out.height];
    flag_edges(out, finest, held, &mut flags);
    apply(out, &flags);
    flag_borders(out, light, finest, held, &mut flags);
    apply(out, &flags);
}

/// Writes the tolerance for held pixels in row `v`; see [`Footprints::allow`].
fn allow(held: Option<&Footprints<'_>>, v: usize, row: &mut [f32]) {
    match held {
        Some(footprints) => footprints.allow(v, row),
        None => row.fill(0.0),
    }
}

/// Flags pixels that disagree with their neighbours on any axis.
fn flag_edges(
    out: &Decoded,
    finest: [Finest; 2],
    held: &[Option<Footprints<'_>>; 2],
    flags: &mut [u8],
) {
    let width = out.width;
    let nan = vec![f32::NAN; width];
    let scratch = || (vec![f32::NAN; width + 6], vec![0.0; width]);
    each_row(width, flags, scratch, |(padded, allowed), v, flags| {
        for (axis, map) in out.axes() {
            allow(held[axis as usize].as_ref(), v, allowed);
            let rows = rows_around(&map.coordinate, &nan, v);
            let around = Around {
                padded: pad(padded, rows[3]),
                rows,
                sigma: &map.sigma[v * width..(v + 1) * width],
                model: finest[axis as usize].model,
                held: allowed,
                finest: finest[axis as usize].period,
                has_beside: [out.width > 2, out.height > 2],
            };
            judge_row(&around, period(map), flags);
        }
    });
}

/// Flags border pixels that are not trusted on some axis.
fn flag_borders(
    out: &Decoded,
    noise: LightNoise,
    finest: [Finest; 2],
    held: &[Option<Footprints<'_>>; 2],
    flags: &mut [u8],
) {
    let width = out.width;
    let nan = vec![f32::NAN; width];
    let scratch = || {
        let rows = [width + 4, width + 2].map(|n| vec![f32::NAN; n]);
        (rows, vec![0.0; width])
    };
    each_row(width, flags, scratch, |(rows, allowed), v, flags| {
        let [padded, padded_light] = rows;
        flags.fill(KEEP);
        let light = rows_around(&out.intensity, &nan, v);
        let padded_light = pad(padded_light, light[1]);
        for (axis, map) in out.axes() {
            allow(held[axis as usize].as_ref(), v, allowed);
            let rows = rows_around(&map.coordinate, &nan, v);
            let near = Near {
                padded: pad(padded, rows[2]),
                rows,
                light,
                padded_light,
                sigma: &map.sigma[v * width..(v + 1) * width],
                model: finest[axis as usize].model,
                held: allowed,
                noise,
            };
            judge_borders(&near, period(map), flags);
        }
    });
}

/// Runs `judge` on every row of flags in parallel, each worker with its own scratch.
fn each_row<S>(
    width: usize,
    flags: &mut [u8],
    scratch: impl Fn() -> S + Sync + Send,
    judge: impl Fn(&mut S, usize, &mut [u8]) + Sync + Send,
) {
    flags
        .par_chunks_mut(width)
        .enumerate()
        .with_min_len(BAND)
        .for_each_init(scratch, |scratch, (v, flags)| judge(scratch, v, flags));
}

/// Copies a row to the middle of a longer buffer and keeps the buffer's ends.
fn pad<'a>(buffer: &'a mut [f32], row: &[f32]) -> &'a [f32] {
    let margin = (buffer.len() - row.len()) / 2;
    buffer[margin..margin + row.len()].copy_from_slice(row);
    buffer
}

/// Returns the period modulo which a map's coordinates are known; 0 if they are absolute.
fn period(map: &AxisMap) -> f32 {
    map.wrapped_px.unwrap_or(0.0) as f32
}

/// Removes flagged pixels from every map.
fn apply(out: &mut Decoded, flags: &[u8]) {
    let width = out.width;
    for map in [&mut out.x, &mut out.y].into_iter().flatten() {
        map.coordinate
            .par_chunks_mut(width)
            .zip(map.sigma.par_chunks_mut(width))
            .zip(map.verdict.par_chunks_mut(width))
            .zip(flags.par_chunks(width))
            .with_min_len(BAND)
            .for_each(|(((coordinate, sigma), verdict), flags)| {
                let out = AxisOut {
                    coordinate,
                    sigma,
                    verdict,
                };
                apply_flags(out, flags);
            });
    }
}

/// `N` rows of a map around row `v`; `beyond` replaces rows outside the map.
fn rows_around<'a, const N: usize>(map: &'a [f32], beyond: &'a [f32], v: usize) -> [&'a [f32]; N] {
    let width = beyond.len();
    std::array::from_fn(|k| {
        let first = (v + k).wrapping_sub(N / 2).wrapping_mul(width);
        if first < map.len() {
            &map[first..first + width]
        } else {
            beyond
        }
    })
}
