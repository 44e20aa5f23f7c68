//! Geometry between key instants: each pixel's values follow parabolas through its values at three
//! key instants.
//!
//! Object, flags and lamps are not interpolated; they are taken from the nearest key instant. In
//! these cases a pixel is traced and not interpolated:
//!
//! - Object, light or side of a crease differ between the key instants, at the pixel's centre or at one
//!   of its samples. Pixels around such a pixel are traced too, as far as anything moves between key
//!   instants, so that thin objects and their shadows are not missed.
//! - The second difference of projector coordinate or light is large. At a kink, such as the border of
//!   two triangles, the parabola's error is an eighth of this difference if the kink is halfway, and
//!   never more than the difference. For a smooth value it is a small fraction of the difference.
//!
//! Where motion is slow, the samples of a mixed pixel are traced only if the pixel is mixed at a key
//! instant; see [`ImageMotion`]. Pixels under blur, such as lit skin, get no blur kernels of their own: the
//! levels under the kernels of the key instants are interpolated.
//!
//! Indirect light is gathered at key instants. A frame takes that of the nearest one, except for traced
//! pixels, which take the light of gather points on their own surface.

use super::geometry::{blur, mark_mixed, some_centers};
use super::input::Input;
use super::{interreflection, mixed};
use crate::exposure::{Blurred, GeometryBuffer, KeyLevels, Mixed, SkinMaps};
use crate::material::COS_CREASE;
use crate::scene::{Span, Surface, World};
use crate::truth::Truth;
use crate::{Plan, Term};
use glam::Vec3;
use phasmid_pattern::Axis;
use rayon::prelude::*;
use std::sync::Arc;

/// Maximum second difference of a pixel's light, as a fraction of the light.
const LIGHT: f32 = 0.02;
/// Maximum second difference of a pixel's projector coordinate, as a multiple of the tolerance.
const BEND: f32 = 4.0;

/// Upper bounds of the motion within a span, in camera pixels.
#[derive(Clone, Copy)]
pub(crate) struct ImageMotion {
    /// Maximum motion of any point from the nearer key instant.
    pub(crate) reach_px: f64,
    /// Maximum second difference of any point's positions at the key instants.
    pub(crate) bend_px: f64,
}

impl ImageMotion {
    /// Returns whether no edge crosses a pixel between two key instants at which the pixel sees the
    /// same surface: an edge would have to move by the width of the pixel, or turn within the
    /// pixel. An edge that turns goes beyond its positions at the key instants by at most an eighth
    /// of the second difference.
    fn is_slow(self) -> bool {
        self.reach_px <= 0.5 && self.bend_px <= 0.5
    }

    /// Returns whether pixels move so little that their mean albedos follow parabolas: no edge of ink or
    /// texture crosses a whole pixel from one key instant to the last.
    pub(crate) fn follows_albedo(self) -> bool {
        self.reach_px <= 0.25 && self.bend_px <= 0.25
    }
}

/// A mixed pixel that is interpolated.
struct KeyMixed {
    /// Indices in the key instants' lists of mixed pixels.
    indices: [u32; 3],
    /// Axes along which the levels of its samples under blur are interpolated.
    along: u8,
}

/// Geometry at the key instants of a span.
pub(crate) struct Between {
    span: Span,
    keys: [Arc<GeometryBuffer>; 3],
    /// Indices, in order, of the pixels whose centres are traced at every instant.
    traced: Vec<u32>,
    /// Pixels in `traced` that may be mixed and are sampled at every instant.
    sampled: Vec<u32>,
    mixed: Vec<KeyMixed>,
    /// Pixels whose levels under blur are interpolated; see [`KeyLevels::along`].
    levels: Vec<u8>,
}

impl Between {
    /// Compares the geometry at the key instants. `tolerance_px` is the approximate tolerance of
    /// projector coordinates in projector pixels.
    pub(crate) fn new(
        span: Span,
        keys: [Arc<GeometryBuffer>; 3],
        world: &World,
        motion: ImageMotion,
        tolerance_px: f32,
    ) -> Self {
        let (width, height) = (keys[0].width, keys[0].height);
        let view = Comparison {
            keys: keys.each_ref().map(Arc::as_ref),
            world,
            tolerance_px,
        };
        let pixels = || (0..width * height).into_par_iter();
        let mut differs: Vec<bool> = pixels().map(|i| view.differs(i)).collect();
        let (mut mixed, bent) = view.mixed(&mut differs);
        let mut near = widened(&differs, width, motion.reach_px.round() as usize + 1);
        for pixel in bent {
            near[pixel as usize] = true;
            differs[pixel as usize] = true;
        }
        let sampled = if motion.is_slow() { &differs } else { &near };
        mixed.retain(|mixed| !sampled[keys[0].mixed[mixed.indices[0] as usize].pixel as usize]);
        let list = |wanted: &(dyn Fn(usize) -> bool + Sync)| -> Vec<u32> {
            pixels().filter(|&i| wanted(i)).map(|i| i as u32).collect()
        };
        let traced = list(&|i| near[i] || view.bends(i));
        let sampled = list(&|i| sampled[i]);
        let mut levels: Vec<u8> = pixels().map(|i| view.smooth_levels(i)).collect();
        for &pixel in &traced {
            levels[pixel as usize] = 0;
        }
        Self {
            span,
            keys,
            traced,
            sampled,
            mixed,
            levels,
        }
    }

    /// Returns the time between key instants in nanoseconds.
    pub(crate) fn spacing_ns(&self) -> u64 {
        self.span.spacing_ns()
    }

    /// Returns the fraction of the pixels that is traced.
    pub(crate) fn traced(&self) -> f64 {
        self.traced.len() as f64 / self.keys[0].x.len().max(1) as f64
    }

    /// Returns the largest fraction of the gather points at which indirect light differs visibly between
    /// two neighbouring key instants. `step_px` is the spacing of the gather points in pixels.
    pub(crate) fn indirect_difference(&self, step_px: usize) -> f64 {
        let [a, b, c] = self.keys.each_ref().map(Arc::as_ref);
        let difference = |keys| interreflection::difference(step_px, keys, &self.traced);
        difference([a, b]).max(difference([b, c]))
    }

    /// Fills the buffer with the geometry of rows that are exposed at device times in nanoseconds. The
    /// scene must already have been moved there.
    pub(crate) fn run(
        &self,
        row_time_ns: impl Fn(usize) -> f64,
        input: &Input<'_>,
        buffer: &mut GeometryBuffer,
    ) {
        let (width, height) = (self.keys[0].width, self.keys[0].height);
        let place = |row| self.span.place(row_time_ns(row)).clamp(-1.0, 1.0);
        let rows: Vec<_> = (0..height).map(|row| Parabola::new(place(row))).collect();
        let occluders = input.find_occluders();
        let input = &input.with(occluders.as_ref());
        self.blend(&rows, input.plan, buffer);
        some_centers(input, &self.traced, buffer);
        let keys = self.keys.each_ref().map(|key| &key.mixed);
        let interpolated = self.mixed.par_iter().map(|mixed| {
            let keys = [0, 1, 2].map(|key: usize| &keys[key][mixed.indices[key] as usize]);
            let row = keys[0].pixel as usize / width;
            (rows[row].mixed(keys), Some(mixed))
        });
        let mut mixed: Vec<_> = interpolated.collect();
        let sampled = mixed::some(input, buffer, &self.sampled);
        mixed.extend(sampled.into_iter().map(|mixed| (mixed, None)));
        mixed.sort_unstable_by_key(|(mixed, _)| mixed.pixel);
        let (mixed, key_mixed): (_, Vec<_>) = mixed.into_iter().unzip();
        buffer.mixed = mixed;
        mark_mixed(buffer);
        if input.plan.has(Term::Interreflection) {
            let key = &self.keys[rows[height / 2].nearest];
            interreflection::between(input, key, [&self.traced, &self.sampled], buffer);
        }
        if let Some(mut skin) = self.skin(&rows) {
            let world = input.worlds.any();
            skin.renew(buffer, input.rays, input.optics, world, &self.traced);
            buffer.skin = Some(skin);
        }
        let levels = KeyLevels {
            keys: self.keys.each_ref().map(Arc::as_ref),
            weights: rows.iter().map(Parabola::weights).collect(),
            along: &self.levels,
            mixed: [0, 1].map(|axis| {
                let indices = |of: &Option<&KeyMixed>| {
                    of.filter(|of| of.along >> axis & 1 != 0)
                        .map(|of| of.indices)
                };
                key_mixed.iter().map(indices).collect()
            }),
        };
        blur(input, buffer, Some(&levels));
    }

    /// Interpolates the skin maps; `None` if there are none.
    fn skin(&self, rows: &[Parabola]) -> Option<SkinMaps> {
        let [a, b, c] = self.keys.each_ref().map(|key| key.skin.as_ref());
        let keys = [a?, b?, c?];
        let mut skin = keys[1].clone();
        let width = self.keys[0].width;
        let [x, y] = &mut skin.from;
        (x.par_chunks_mut(width), y.par_chunks_mut(width))
            .into_par_iter()
            .zip(skin.px_per_mm.par_chunks_mut(width))
            .zip(skin.tissue.par_chunks_mut(width))
            .zip(rows)
            .enumerate()
            .for_each(|(row, ((((x, y), px_per_mm), tissue), parabola))| {
                let nearest = keys[parabola.nearest];
                let from = row * width;
                let of = |axis: usize| keys.map(|key| &key.from[axis][from..from + width]);
                parabola.blend(of(0), x);
                parabola.blend(of(1), y);
                copy(px_per_mm, &nearest.px_per_mm, from);
                copy(tissue, &nearest.tissue, from);
            });
        Some(skin)
    }

    fn blend(&self, rows: &[Parabola], plan: &Plan, buffer: &mut GeometryBuffer) {
        let keys = self.keys.each_ref().map(Arc::as_ref);
        let width = keys[0].width;
        buffer.resize(width, keys[0].height, plan);
        buffer.blur_stretch = keys[0].blur_stretch;
        buffer.bands(1).into_par_iter().for_each(|band| {
            let parabola = &rows[band.first_row];
            let nearest = keys[parabola.nearest];
            let from = band.first_row * width;
            let blend = |out: &mut [f32], map: fn(&GeometryBuffer) -> &[f32]| {
                if !out.is_empty() {
                    let keys = keys.map(|key| &map(key)[from..from + out.len()]);
                    parabola.blend(keys, out);
                }
            };
            blend(band.x, |key| &key.x);
            blend(band.y, |key| &key.y);
            blend(band.projected, |key| &key.projected);
            blend(band.ambient, |key| &key.ambient);
            blend(band.flickering, |key| &key.flickering);
            blend(band.depth, |key| &key.depth);
            blend(band.blur, |key| &key.blur);
            copy(band.x_slope, &nearest.x_slope, from);
            copy(band.y_slope, &nearest.y_slope, from);
            copy(band.lamps, &nearest.lamps, from);
            copy(band.evenly, &nearest.evenly, from);
            copy(band.surface, &nearest.surface, from);
            copy(band.normal, &nearest.normal, from);
            copy(band.flags, &nearest.flags, from);
        });
    }
}

/// Copies a band of a map; does nothing if the map is empty.
fn copy<T: Copy>(to: &mut [T], map: &[T], from: usize) {
    if !to.is_empty() {
        to.copy_from_slice(&map[from..from + to.len()]);
    }
}

/// A parabola through the values at the key instants, evaluated at one time between them.
struct Parabola {
    half: f32,
    half_square: f32,
    nearest: usize,
}

impl Parabola {
    fn new(place: f64) -> Self {
        Self {
            half: (0.5 * place) as f32,
            half_square: (0.5 * place * place) as f32,
            nearest: (place.round() + 1.0) as usize,
        }
    }

    /// Returns the value of the parabola. A value that is equal at all key instants has no rounding
    /// error.
    #[inline(always)]
    fn at(&self, [a, b, c]: [f32; 3]) -> f32 {
        b + (self.half * (c - a) + self.half_square * ((a - b) + (c - b)))
    }

    /// Returns the weights of the values at the key instants.
    fn weights(&self) -> [f32; 3] {
        let Self {
            half, half_square, ..
        } = *self;
        [
            half_square - half,
            1.0 - 2.0 * half_square,
            half_square + half,
        ]
    }

    fn blend(&self, [a, b, c]: [&[f32]; 3], out: &mut [f32]) {
        for (out, ((a, b), c)) in out.iter_mut().zip(a.iter().zip(b).zip(c)) {
            *out = self.at([*a, *b, *c]);
        }
    }

    /// Interpolates the samples of a mixed pixel.
    fn mixed(&self, keys: [&Mixed; 3]) -> Mixed {
        let all = |map: fn(&Mixed) -> &[f32; 16]| {
            let keys = keys.map(map);
            std::array::from_fn(|k| self.at(keys.map(|key| key[k])))
        };
        Mixed {
            x: all(|key| &key.x),
            y: all(|key| &key.y),
            projected: all(|key| &key.projected),
            blur: all(|key| &key.blur),
            ambient: self.at(keys.map(|key| key.ambient)),
            flickering: self.at(keys.map(|key| key.flickering)),
            ..keys[self.nearest].clone()
        }
    }
}

struct Comparison<'a> {
    keys: [&'a GeometryBuffer; 3],
    world: &'a World,
    tolerance_px: f32,
}

impl Comparison<'_> {
    /// Returns whether object, light or side of a crease at a pixel's centre differs between the key
    /// instants.
    fn differs(&self, i: usize) -> bool {
        let [a, b, c] = self.keys;
        let differ = |a: &GeometryBuffer, b: &GeometryBuffer| {
            if (a.flags[i] ^ b.flags[i]) & (Truth::SEEN | Truth::LIT) != 0
                || a.lamps.get(i) != b.lamps.get(i)
            {
                return true;
            }
            let [one, other] = [a, b].map(|key| Surface(key.surface[i]));
            if one == other || a.flags[i] & Truth::SEEN == 0 {
                return false;
            }
            let [along, across] = [a, b].map(|key| Vec3::from_array(key.normal[i]));
            self.world.object(one) != self.world.object(other) || along.dot(across) < COS_CREASE
        };
        differ(a, b) || differ(b, c)
    }

    /// Returns whether the parabolas of a pixel's projector coordinates or light may be inaccurate.
    fn bends(&self, i: usize) -> bool {
        let of = |map: fn(&GeometryBuffer) -> &[f32]| self.keys.map(|key| map(key)[i]);
        let seen = self.keys[1].flags[i] & Truth::SEEN != 0;
        let lit = self.keys[1].flags[i] & Truth::LIT != 0;
        seen && (bent_light(of(|key| &key.ambient))
            || lit
                && (bent_light(of(|key| &key.projected))
                    || self.bent(of(|key| &key.x))
                    || self.bent(of(|key| &key.y))))
    }

    /// Returns the axes along which the parabola of a pixel's level under blur is accurate; see
    /// [`KeyLevels::along`].
    fn smooth_levels(&self, i: usize) -> u8 {
        self.smooth(|axis, pattern_axis| {
            let footprint = self.keys[1].footprint(axis, i);
            self.is_smooth(
                self.keys.map(|key| key.lit_from(pattern_axis)[i]),
                &footprint,
            )
        })
    }

    /// Same as [`Self::smooth_levels`], for the samples of a mixed pixel that is alike at all key
    /// instants.
    fn smooth_samples(&self, keys: [&Mixed; 3]) -> u8 {
        let lit = |k: &usize| keys[1].projected[*k] > 0.0;
        self.smooth(|axis, pattern_axis| {
            (0..16).filter(lit).all(|k| {
                let coordinates = keys.map(|key| match pattern_axis {
                    Axis::X => key.x[k],
                    Axis::Y => key.y[k],
                });
                let footprint = self.keys[1].footprint_of_sample(axis, keys[1], k);
                self.is_smooth(coordinates, &footprint)
            })
        })
    }

    /// Returns the axes along which there are kernels and levels are smooth.
    fn smooth(&self, is_smooth: impl Fn(usize, Axis) -> bool) -> u8 {
        let mut along = 0;
        for (axis, pattern_axis) in [Axis::X, Axis::Y].into_iter().enumerate() {
            let has_kernels = self.keys[1].kernels[axis].is_some();
            along |= u8::from(has_kernels && is_smooth(axis, pattern_axis)) << axis;
        }
        along
    }

    /// Returns whether the parabola through the levels at three coordinates is accurate.
    fn is_smooth(&self, [a, b, c]: [f32; 3], footprint: &Blurred<'_>) -> bool {
        let distance = (b - a).abs().max((c - b).abs());
        footprint.has_parabolic_level(distance, self.tolerance_px)
    }

    /// Returns whether the parabola of a projector coordinate may be inaccurate; `true` if a
    /// coordinate is NaN.
    fn bent(&self, keys: [f32; 3]) -> bool {
        !(second_difference(keys).abs() <= BEND * self.tolerance_px)
    }

    /// Returns two lists of the mixed pixels that are alike at all key instants: the indices of
    /// mixed pixels whose parabolas are accurate, and the other mixed pixels. Marks all mixed pixels
    /// that are not alike as different.
    fn mixed(&self, differs: &mut [bool]) -> (Vec<KeyMixed>, Vec<u32>) {
        let lists = self.keys.map(|key| key.mixed.as_slice());
        let mut next = [0; 3];
        let (mut same, mut bent) = (Vec::new(), Vec::new());
        loop {
            let heads: [Option<&Mixed>; 3] = std::array::from_fn(|key| lists[key].get(next[key]));
            let pixels = heads.map(|head| head.map_or(u32::MAX, |mixed| mixed.pixel));
            let pixel = pixels.into_iter().fold(u32::MAX, u32::min);
            if pixel == u32::MAX {
                return (same, bent);
            }
            match heads {
                [Some(a), Some(b), Some(c)] if pixels == [pixel; 3] && seen_alike([a, b, c]) => {
                    match self.mixed_bent([a, b, c]) {
                        true => bent.push(pixel),
                        false => same.push(KeyMixed {
                            indices: next.map(|index| index as u32),
                            along: self.smooth_samples([a, b, c]),
                        }),
                    }
                }
                _ => differs[pixel as usize] = true,
            }
            for (index, of) in next.iter_mut().zip(pixels) {
                *index += usize::from(of == pixel);
            }
        }
    }

    /// Returns whether the parabolas of a mixed pixel's samples may be inaccurate.
    fn mixed_bent(&self, keys: [&Mixed; 3]) -> bool {
        (0..16).any(|k| {
            let of = |map: fn(&Mixed) -> &[f32; 16]| keys.map(|key| map(key)[k]);
            bent_light(of(|key| &key.projected))
                || self.bent(of(|key| &key.x))
                || self.bent(of(|key| &key.y))
        })
    }
}

/// Maximum second difference of a sample's projector coordinates, in projector pixels. Above it, the
/// sample is taken to see different surfaces at the key instants.
const ONE_SURFACE_PX: f32 = 8.0;

/// Returns whether each sample of a mixed pixel sees the same surface in the same light at all key
/// instants, judged by its coordinates, light and tissue.
fn seen_alike(keys: [&Mixed; 3]) -> bool {
    let tissue = |key: &Mixed| key.skin.as_ref().map(|skin| skin.tissue);
    let differs = |k: usize| {
        let lit = keys.map(|key| key.projected[k] > 0.0);
        let far = |map: fn(&Mixed) -> &[f32; 16]| {
            let bend = second_difference(keys.map(|key| map(key)[k]));
            !(bend.abs() <= ONE_SURFACE_PX)
        };
        lit != [lit[1]; 3] || far(|key| &key.x) || far(|key| &key.y)
    };
    !bent_light(keys.map(|key| key.ambient))
        && keys.map(tissue) == [tissue(keys[1]); 3]
        && !(0..16).any(differs)
}

fn second_difference([a, b, c]: [f32; 3]) -> f32 {
    (a - b) + (c - b)
}

/// Returns whether the parabola of an amount of light may be inaccurate.
fn bent_light(keys: [f32; 3]) -> bool {
    second_difference(keys).abs() > LIGHT * keys[1]
}

/// Marks all pixels within `reach` columns and rows of a marked pixel.
fn widened(marked: &[bool], width: usize, reach: usize) -> Vec<bool> {
    let height = marked.len() / width;
    let mut wide = vec![false; marked.len()];
    for (from, to) in marked.chunks(width).zip(wide.chunks_mut(width)) {
        for u in (0..width).filter(|&u| from[u]) {
            to[u.saturating_sub(reach)..(u + reach + 1).min(width)].fill(true);
        }
    }
    let mut out = vec![false; marked.len()];
    out.par_chunks_mut(width).enumerate().for_each(|(v, row)| {
        for near in v.saturating_sub(reach)..(v + reach + 1).min(height) {
            for (to, from) in row.iter_mut().zip(&wide[near * width..][..width]) {
                *to |= from;
            }
        }
    });
    out
}
