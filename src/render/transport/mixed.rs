//! Mixed pixels: pixels whose footprint covers more than one surface or a shadow edge. The pixel's
//! centre does not represent them, so the light of 4 x 4 samples is averaged.
//!
//! Candidates are pixels that differ from one of their eight neighbours; their samples then decide.
//! A sliver thinner than a pixel that covers no pixel centre is missed, unless more samples per
//! pixel are requested.

use super::cast::{Cast, cast};
use super::input::Input;
use super::rays::{Bundle, Rays};
use super::skin;
use crate::exposure::{GeometryBuffer, Mixed, Optics};
use crate::material::COS_CREASE;
use crate::scene::{Surface, TILE, World};
use crate::truth::Truth;
use crate::{Plan, Term};
use glam::{DVec2, DVec3, Vec3};
use phasmid_geometry::raycast::{LANES, Scratch};
use rayon::prelude::*;
use std::borrow::Cow;

/// Finds and samples the mixed pixels of the maps. Pixels known to be `uneven` are candidates too;
/// that list may be empty.
pub(super) fn run(input: &Input<'_>, view: &GeometryBuffer, uneven: &[bool]) -> Vec<Mixed> {
    let found = (0..view.height)
        .into_par_iter()
        .map_init(Scratch::default, |scratch, row| {
            let edges = Edges::new(input, row);
            let mut samples = Vec::new();
            if input.worlds.stop.is_asked() {
                return samples;
            }
            for column in 0..view.width {
                let known = uneven.get(row * view.width + column) == Some(&true);
                if known || edges.touch(input, view, column, row) {
                    let (optics, plan) = (input.optics, input.plan);
                    samples.extend(sample(&edges, optics, plan, column, row, scratch));
                }
            }
            samples
        })
        .collect::<Vec<_>>();
    found.into_iter().flatten().collect()
}

/// Finds and samples the mixed ones among some pixels, in a scene at one instant.
pub(super) fn some(input: &Input<'_>, view: &GeometryBuffer, pixels: &[u32]) -> Vec<Mixed> {
    let edges = Edges::new(input, 0);
    pixels
        .par_chunks(LANES)
        .map_init(Scratch::default, |scratch, pixels| {
            let places = pixels.iter().map(|&pixel| {
                let pixel = pixel as usize;
                (pixel % view.width, pixel / view.width)
            });
            places
                .filter(|&(column, row)| edges.touch(input, view, column, row))
                .filter_map(|(u, v)| sample(&edges, input.optics, input.plan, u, v, scratch))
                .collect::<Vec<_>>()
        })
        .flatten_iter()
        .collect()
}

struct Edges<'a> {
    world: Cow<'a, World>,
    rays: &'a Rays<'a>,
    /// Width of a pixel at unit depth.
    pixel_slope: f32,
}

/// Data to decide whether two points belong to one smooth surface.
#[derive(Clone, Copy)]
struct Place {
    surface: Surface,
    lit: bool,
    /// Bit mask of the lamps that light the point.
    lamps: u32,
    normal: Vec3,
    direction: Vec3,
    depth: f32,
}

impl<'a> Edges<'a> {
    fn new(input: &Input<'a>, row: usize) -> Self {
        let focal_px = input.optics.camera.lens.focal_px;
        Self {
            world: input.worlds.at(row),
            rays: input.rays,
            pixel_slope: (1.0 / focal_px.min_element()) as f32,
        }
    }

    #[inline(always)]
    fn touch(&self, input: &Input<'_>, map: &GeometryBuffer, column: usize, row: usize) -> bool {
        match input.plan.has(Term::Lights) {
            true => self.touches::<true>(map, column, row),
            false => self.touches::<false>(map, column, row),
        }
    }

    /// Returns whether a pixel differs from one of its neighbours. Most pixels share triangle and
    /// light with all of them, which is visible from two integer maps.
    #[inline(always)]
    fn touches<const LAMPS: bool>(&self, map: &GeometryBuffer, column: usize, row: usize) -> bool {
        let here = row * map.width + column;
        let lit = |i: usize| map.flags[i] & Truth::LIT;
        let lamps = |i: usize| if LAMPS { map.lamps[i] } else { 0 };
        let (first, last) = (column.saturating_sub(1), (column + 1).min(map.width - 1));
        for v in row.saturating_sub(1)..=(row + 1).min(map.height - 1) {
            for u in first..=last {
                let there = v * map.width + u;
                if map.surface[there] == map.surface[here]
                    && lit(there) == lit(here)
                    && lamps(there) == lamps(here)
                {
                    continue;
                }
                if self.edge(&self.place(map, column, row), &self.place(map, u, v)) {
                    return true;
                }
            }
        }
        false
    }

    #[inline(always)]
    fn place(&self, map: &GeometryBuffer, column: usize, row: usize) -> Place {
        let i = row * map.width + column;
        Place {
            surface: Surface(map.surface[i]),
            lit: map.flags[i] & Truth::LIT != 0,
            lamps: map.lamps.get(i).copied().unwrap_or(0),
            normal: Vec3::from_array(map.normal[i]),
            direction: self.rays.center(column, row).as_vec3(),
            depth: map.depth[i],
        }
    }

    /// Returns whether an edge of the surface or of its light lies between two points.
    #[inline(always)]
    fn edge(&self, a: &Place, b: &Place) -> bool {
        if a.lit != b.lit || a.lamps != b.lamps {
            return true;
        }
        if a.surface == b.surface {
            return false;
        }
        if a.surface == Surface::NONE || b.surface == Surface::NONE {
            return true;
        }
        let one_mesh = self.world.is_triangle(a.surface)
            && self.world.is_triangle(b.surface)
            && self.world.object(a.surface) == self.world.object(b.surface);
        !one_mesh || a.normal.dot(b.normal) < COS_CREASE || self.jump(a, b)
    }

    /// Returns whether b is off the tangent plane at a by more than a pixel's size on the surface.
    #[inline(always)]
    fn jump(&self, a: &Place, b: &Place) -> bool {
        let facing = a.normal.dot(b.direction);
        let predicted = a.normal.dot(a.direction) * a.depth / facing;
        let cos = (-facing / b.direction.length()).max(0.05);
        !((predicted - b.depth).abs() <= a.depth * self.pixel_slope / cos)
    }
}

/// Casts the samples of a pixel; `None` if all see one smooth, evenly lit surface.
fn sample(
    edges: &Edges<'_>,
    optics: &Optics,
    plan: &Plan,
    column: usize,
    row: usize,
    scratch: &mut Scratch,
) -> Option<Mixed> {
    let directions = std::array::from_fn(|lane| {
        // One sample per grid cell, sheared so that all sixteen differ in column and in row (Chiu,
        // Shirley, Wang: "Multi-Jittered Sampling", Graphics Gems IV, 1994): an edge parallel to
        // the pixel borders is resolved at sixteen positions rather than four.
        let (i, j) = (lane % TILE, lane / TILE);
        let inside = |cell: usize, other: usize| {
            let n = TILE as f64;
            (cell as f64 + (other as f64 + 0.5) / n) / n - 0.5
        };
        let px = DVec2::new(
            column as f64 + inside(i, j),
            row as f64 + inside(j, TILE - 1 - i),
        );
        edges.rays.through(px)
    });
    let bundle = Bundle {
        origin: DVec3::ZERO,
        directions,
        used: [true; LANES],
        cell: 1.0 / TILE as f64,
    };
    let cast = cast(&edges.world, optics, plan, &bundle, scratch);
    let place = |lane: usize| Place {
        surface: cast.hits.surface[lane],
        lit: cast.lit[lane],
        lamps: cast.shaded.lamps[lane],
        normal: cast.hits.normal(lane).as_vec3(),
        direction: directions[lane].as_vec3(),
        depth: cast.shaded.point[2][lane] as f32,
    };
    let places: [Place; LANES] = std::array::from_fn(place);
    // Only adjacent samples are compared, so that a curved surface does not count as an edge.
    let edge = (0..LANES).any(|lane| {
        let right = (lane % TILE + 1 < TILE).then_some(lane + 1);
        let below = (lane + TILE < LANES).then_some(lane + TILE);
        [right, below]
            .into_iter()
            .flatten()
            .any(|next| edges.edge(&places[lane], &places[next]))
    });
    edge.then(|| {
        let pixel = (row * edges.rays.width + column) as u32;
        let mut mixed = gather(optics, &cast, pixel);
        if plan.has(Term::Subsurface) {
            for lane in (0..LANES).filter(|&lane| cast.lit[lane]) {
                skin::into_sample(&edges.world, optics, &cast, lane, (&mut mixed, lane));
            }
        }
        mixed
    })
}

fn gather(optics: &Optics, cast: &Cast, pixel: u32) -> Mixed {
    let mut mixed = Mixed::new(pixel);
    // The footprint of a sample is a quarter of the pixel's along each side.
    let quarter = |v: f64| (v / TILE as f64) as f32;
    let shaded = &cast.shaded;
    for lane in (0..LANES).filter(|&lane| cast.hits.is_hit(lane)) {
        mixed.ambient += shaded.ambient[lane] as f32 / LANES as f32;
        mixed.flickering += shaded.flickering[lane] as f32 / LANES as f32;
        if !cast.lit[lane] {
            continue;
        }
        mixed.x[lane] = shaded.px[0][lane] as f32;
        mixed.y[lane] = shaded.px[1][lane] as f32;
        mixed.x_slope[lane] = shaded.footprint[0].map(|by| quarter(by[lane]));
        mixed.y_slope[lane] = shaded.footprint[1].map(|by| quarter(by[lane]));
        mixed.projected[lane] = shaded.projected[lane] as f32;
        mixed.blur[lane] = optics.blur_px(cast.origin + cast.point(lane));
    }
    mixed
}
