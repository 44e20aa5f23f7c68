//! Sampling of every pixel with several rays. With depth of field, the rays pass through several
//! points of the pupil.
//!
//! The rays of a packet share an origin: a packet is one sample of each of the sixteen pixels of a
//! tile, and all its rays pass through one point of the pupil. If the samples of a pixel see one
//! smooth, evenly lit surface, they are replaced by the closed form of the pixel's footprint, which
//! is more accurate than their mean. If not, the samples are kept.

use super::aperture::widened;
use super::cast::{Cast, cast};
use super::input::Input;
use super::rays::Bundle;
use super::skin;
use crate::Term;
use crate::exposure::{GeometryBuffer, Mixed};
use crate::material::COS_CREASE;
use crate::scene::{Layout, Surface, World};
use crate::truth::Truth;
use glam::{DMat2, DVec2, DVec3, Vec3};
use phasmid_geometry::raycast::{LANES, Scratch};
use rayon::prelude::*;

/// Maximum distance of a sample from the position that the closed form predicts, as a fraction of
/// the footprint's width.
const BENT: f64 = 0.02;

/// Step between the indices of the pupil points of consecutive samples. Since it is odd, all points
/// are visited. This value minimises the correlation between pupil points and positions in the
/// pixel. At the worst position of an edge, the fraction of samples beyond the edge is off by 0.12
/// for sixteen samples and 0.05 for sixty-four, on average over directions and blurs (independent
/// samples: 0.13 and 0.06).
const STEP: usize = 55;

/// Returns the index of the pupil point of the kth of `count` samples.
pub(crate) fn pupil_index(k: usize, count: usize) -> usize {
    k * STEP % count
}

/// Returns the angle by which a tile's pupil points are rotated, so that different tiles use
/// different points: multiples of the golden ratio fill a turn evenly (Weyl).
pub(crate) fn turn(tile: usize) -> f64 {
    (tile as f64 * 0.618_033_988_749_894_9).fract() * std::f64::consts::TAU
}

/// Returns the position of the kth of `side` x `side` samples within its pixel: one sample per grid
/// cell, sheared so that all samples differ in column and row, as in [`mixed`](super::mixed).
pub(crate) fn offset(k: usize, side: usize) -> DVec2 {
    let n = side as f64;
    let (i, j) = ((k % side) as f64, (k / side) as f64);
    let inside = |cell: f64, other: f64| (cell + (other + 0.5) / n) / n - 0.5;
    DVec2::new(inside(i, j), inside(j, n - 1.0 - i))
}

/// Casts the samples of all pixels.
pub(super) struct Sampler<'a> {
    pub(super) input: &'a Input<'a>,
    /// Number of samples along a side of a pixel.
    pub(super) side: usize,
}

impl Sampler<'_> {
    /// Returns the samples of the pixels for which the closed form is invalid, in pixel order. There
    /// must be at least sixteen samples per pixel.
    pub(super) fn gather(&self, map: &GeometryBuffer) -> Vec<Mixed> {
        let mut bands = self.visit(map, |found, pixel, lane, casts| {
            for group in casts.chunks(LANES) {
                found.push(self.mixed(pixel, lane, group, casts.len()));
            }
        });
        for band in &mut bands {
            band.sort_by_key(|mixed| mixed.pixel);
        }
        bands.into_iter().flatten().collect()
    }

    /// Returns for each pixel whether the closed form is invalid.
    pub(super) fn uneven(&self, map: &GeometryBuffer) -> Vec<bool> {
        let bands = self.visit(map, |found, pixel, _, _| found.push(pixel));
        let mut uneven = vec![false; map.surface.len()];
        for pixel in bands.into_iter().flatten() {
            uneven[pixel] = true;
        }
        uneven
    }

    /// Casts all samples, tile by tile, and calls a function with the samples of each pixel for
    /// which the closed form is invalid. Returns one result per band of rows; pixels are not in
    /// order within a band.
    fn visit<T: Send>(
        &self,
        map: &GeometryBuffer,
        found: impl Fn(&mut Vec<T>, usize, usize, &[Cast]) + Sync,
    ) -> Vec<Vec<T>> {
        let rows = self.input.worlds.rows_together();
        (0..map.height.div_ceil(rows))
            .into_par_iter()
            .map_init(
                || (Scratch::default(), Vec::new()),
                |(scratch, casts), band| {
                    let mut kept = Vec::new();
                    if self.input.worlds.stop.is_asked() {
                        return kept;
                    }
                    let world = &self.input.worlds.at(band * rows);
                    for column in (0..map.width).step_by(LANES / rows) {
                        let tile = Tile::new(self, map, column, band * rows);
                        self.cast(world, &tile, casts, scratch);
                        for lane in (0..LANES).filter(|&lane| tile.used[lane]) {
                            if !self.even(map, &tile, lane, casts) {
                                found(&mut kept, tile.pixel(map.width, lane), lane, casts);
                            }
                        }
                    }
                    kept
                },
            )
            .collect()
    }

    fn cast(&self, world: &World, tile: &Tile, casts: &mut Vec<Cast>, scratch: &mut Scratch) {
        casts.clear();
        let Input {
            optics,
            plan,
            aperture,
            occluders,
            ..
        } = *self.input;
        let occluders = occluders.filter(|_| aperture.radius_mm == 0.0);
        let count = self.side * self.side;
        for k in 0..count {
            let offset = offset(k, self.side);
            let origin = self
                .input
                .aperture
                .point(pupil_index(k, count), count, tile.turn);
            let directions = std::array::from_fn(|lane| {
                let middle = tile.center[lane] + (tile.by_px[lane] * offset).extend(0.0);
                self.input.aperture.through(origin, middle)
            });
            let bundle = Bundle {
                origin,
                directions,
                used: tile.used,
                cell: 1.0 / self.side as f64,
            };
            casts.push(cast(world, optics, plan, &bundle, occluders, scratch));
        }
    }

    /// Returns whether all samples of a pixel see the same smooth surface as its centre, in the
    /// same light, and at the positions that the closed form of its footprint predicts.
    fn even(&self, map: &GeometryBuffer, tile: &Tile, lane: usize, casts: &[Cast]) -> bool {
        let pixel = tile.pixel(map.width, lane);
        let here = Surface(map.surface[pixel]);
        let lit = map.flags[pixel] & Truth::LIT != 0;
        let lamps = map.lamps.get(pixel).copied().unwrap_or(0);
        let same = |cast: &Cast| {
            let there = cast.hits.surface[lane];
            cast.lit[lane] == lit
                && cast.shaded.lamps[lane] == lamps
                && (there == here || self.smooth(map, pixel, lane, cast))
        };
        if !casts.iter().all(same) || self.blurs_albedo(here) {
            return false;
        }
        if !lit {
            return true;
        }
        let blur = self.input.aperture.blur_px(f64::from(map.depth[pixel]));
        let reach = 1.0 + 2.0 * blur * DVec2::new(1.0, self.input.aperture.pixel_aspect);
        let to_px = tile.by_px[lane].inverse();
        let axes = [(&map.x, &map.x_slope), (&map.y, &map.y_slope)];
        axes.into_iter().enumerate().all(|(axis, (at, slope))| {
            let Some(slope) = slope.get(pixel) else {
                return true;
            };
            let slope = DVec2::new(slope[0].into(), slope[1].into());
            let bar = BENT * slope.abs().dot(reach) + 1e-3;
            casts.iter().all(|cast| {
                let point = cast.origin + cast.point(lane);
                let apparent = point.truncate() / point.z;
                let offset = to_px * (apparent - tile.center[lane].truncate());
                let predicted = f64::from(at[pixel]) + slope.dot(offset);
                (cast.shaded.px[axis][lane] - predicted).abs() <= bar
            })
        })
    }

    /// Returns whether depth of field blurs an albedo that varies over the surface. The closed form
    /// averages the albedo over the footprint only, so it is invalid then.
    fn blurs_albedo(&self, surface: Surface) -> bool {
        self.input.aperture.radius_mm > 0.0
            && self.input.plan.has(Term::AlbedoMaps)
            && surface != Surface::NONE
            && self
                .input
                .worlds
                .any()
                .materials
                .vary(self.input.worlds.any().object(surface))
    }

    /// Returns whether a sample hits another triangle of the mesh that the pixel's centre sees, and
    /// this triangle continues the surface without a crease.
    fn smooth(&self, map: &GeometryBuffer, pixel: usize, lane: usize, cast: &Cast) -> bool {
        let (here, there) = (Surface(map.surface[pixel]), cast.hits.surface[lane]);
        here != Surface::NONE
            && there != Surface::NONE
            && self.input.worlds.any().is_triangle(here)
            && self.input.worlds.any().is_triangle(there)
            && self.input.worlds.any().object(here) == self.input.worlds.any().object(there)
            && Vec3::from_array(map.normal[pixel]).dot(cast.hits.normal(lane).as_vec3())
                >= COS_CREASE
    }

    /// Combines sixteen of `count` samples into a mixed pixel, weighted so that the sum over all
    /// groups of sixteen is the mean over all samples.
    fn mixed(&self, pixel: usize, lane: usize, group: &[Cast], count: usize) -> Mixed {
        let mut mixed = Mixed::new(pixel as u32);
        let weight = LANES as f64 / count as f64;
        // Each sample represents its fraction of the pixel and of the pupil.
        let part = 1.0 / self.side as f32;
        for (k, cast) in group.iter().enumerate() {
            if !cast.hits.is_hit(lane) {
                continue;
            }
            let shaded = &cast.shaded;
            mixed.ambient += (shaded.ambient[lane] * weight) as f32 / LANES as f32;
            mixed.flickering += (shaded.flickering[lane] * weight) as f32 / LANES as f32;
            if !cast.lit[lane] {
                continue;
            }
            let blur = self.input.aperture.blur_px(cast.hits.t[lane]);
            let slope = |axis: usize| {
                let whole = shaded.footprint[axis].map(|by| by[lane] as f32);
                widened(whole, blur, self.input.aperture.pixel_aspect).map(|s| s * part)
            };
            mixed.x[k] = shaded.px[0][lane] as f32;
            mixed.y[k] = shaded.px[1][lane] as f32;
            mixed.x_slope[k] = slope(0);
            mixed.y_slope[k] = slope(1);
            mixed.projected[k] = (shaded.projected[lane] * weight) as f32;
            mixed.blur[k] = self.input.optics.blur_px(cast.origin + cast.point(lane));
            if self.input.plan.has(Term::Subsurface) {
                skin::into_sample(
                    self.input.worlds.any(),
                    self.input.optics,
                    cast,
                    lane,
                    (&mut mixed, k),
                );
            }
        }
        mixed
    }
}

/// Sixteen pixels that are sampled together.
struct Tile {
    column: usize,
    row: usize,
    layout: Layout,
    used: [bool; LANES],
    /// Directions through the pixel centres, with z = 1.
    center: [DVec3; LANES],
    /// Derivatives of the directions with respect to the position in the image in pixels.
    by_px: [DMat2; LANES],
    /// Angle by which the pupil points are rotated.
    turn: f64,
}

impl Tile {
    fn new(sampler: &Sampler<'_>, map: &GeometryBuffer, column: usize, row: usize) -> Self {
        let rows = sampler.input.worlds.rows_together();
        let across = LANES / rows;
        let layout = Layout::of(rows);
        let place = |lane: usize| {
            let (right, down) = layout.place(lane);
            (column + right, row + down)
        };
        let rays = sampler.input.rays;
        let center = std::array::from_fn(|lane| {
            let (u, v) = place(lane);
            rays.center(u.min(map.width - 1), v.min(map.height - 1))
        });
        let index = (row / rows) * map.width.div_ceil(across) + column / across;
        Self {
            column,
            row,
            layout,
            used: std::array::from_fn(|lane| {
                let (u, v) = place(lane);
                u < map.width && v < map.height
            }),
            by_px: center.map(|direction| rays.slope(direction)),
            center,
            turn: turn(index),
        }
    }

    fn pixel(&self, width: usize, lane: usize) -> usize {
        let (right, down) = self.layout.place(lane);
        (self.row + down) * width + self.column + right
    }
}
