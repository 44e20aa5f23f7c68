//! Mixed pixels: pixels whose footprint covers more than one surface or a shadow edge. The centre of
//! such a pixel does not represent it, so the light of 4 x 4 samples is averaged.
//!
//! Candidates are pixels that differ from one of their eight neighbours; the samples of a candidate
//! decide whether it is mixed. A sliver thinner than a pixel that covers no pixel centre is missed,
//! unless more samples per pixel are requested.

use super::cast::{Cast, cast};
use super::edges::{Neighbours, Place};
use super::input::Input;
use super::rays::{Bundle, Rays};
use super::skin;
use crate::exposure::{GeometryBuffer, Mixed, Optics};
use crate::scene::{Occluders, TILE, World};
use crate::{Plan, Term};
use glam::{DVec2, DVec3};
use phasmid_geometry::raycast::{LANES, Scratch};
use rayon::prelude::*;
use std::borrow::Cow;

/// Finds and samples the mixed pixels of the maps. Pixels marked in `uneven` are candidates as well;
/// `uneven` may be empty.
pub(super) fn run(input: &Input<'_>, view: &GeometryBuffer, uneven: &[bool]) -> Vec<Mixed> {
    in_rows(
        input,
        view,
        |_| true,
        |pixel, apart| apart || uneven.get(pixel) == Some(&true),
    )
}

/// Finds and samples the mixed pixels among a list of pixels in ascending order.
pub(super) fn some(input: &Input<'_>, view: &GeometryBuffer, pixels: &[u32]) -> Vec<Mixed> {
    let before = |pixel: usize| pixels.partition_point(|&p| (p as usize) < pixel);
    let has_any = |row: usize| before(row * view.width) < before((row + 1) * view.width);
    in_rows(input, view, has_any, |pixel, apart| {
        apart && pixels.binary_search(&(pixel as u32)).is_ok()
    })
}

/// Samples the candidates in some rows. A function selects the candidates by the pixel's index and
/// by whether an edge lies between the centres of the pixel and of a neighbour.
fn in_rows(
    input: &Input<'_>,
    view: &GeometryBuffer,
    has_any: impl Fn(usize) -> bool + Sync,
    is_candidate: impl Fn(usize, bool) -> bool + Sync,
) -> Vec<Mixed> {
    let rows: Vec<_> = (0..view.height).filter(|&row| has_any(row)).collect();
    let found = rows
        .into_par_iter()
        .map_init(
            <(Neighbours, Scratch)>::default,
            |(neighbours, scratch), row| {
                let edges = Edges::new(input, row);
                let mut samples = Vec::new();
                if input.worlds.stop.is_asked() {
                    return samples;
                }
                let slope = edges.pixel_slope;
                let apart = neighbours.apart(input, &edges.world, view, row, slope);
                for (column, apart) in apart.iter().enumerate() {
                    if is_candidate(row * view.width + column, *apart != 0) {
                        let (optics, plan) = (input.optics, input.plan);
                        samples.extend(sample(&edges, optics, plan, column, row, scratch));
                    }
                }
                samples
            },
        )
        .collect::<Vec<_>>();
    found.into_iter().flatten().collect()
}

struct Edges<'a> {
    world: Cow<'a, World>,
    rays: &'a Rays<'a>,
    occluders: Option<&'a Occluders>,
    /// Width of a pixel at unit depth.
    pixel_slope: f32,
}

impl<'a> Edges<'a> {
    fn new(input: &Input<'a>, row: usize) -> Self {
        let focal_px = input.optics.camera.lens.focal_px;
        Self {
            world: input.worlds.at(row),
            rays: input.rays,
            occluders: input.occluders,
            pixel_slope: (1.0 / focal_px.min_element()) as f32,
        }
    }
}

/// Casts the samples of a pixel; `None` if all samples see one smooth, evenly lit surface.
fn sample(
    edges: &Edges<'_>,
    optics: &Optics,
    plan: &Plan,
    column: usize,
    row: usize,
    scratch: &mut Scratch,
) -> Option<Mixed> {
    let directions = std::array::from_fn(|lane| {
        // One sample per grid cell, sheared so that all sixteen samples differ in column and in row
        // (Chiu, Shirley, Wang: "Multi-Jittered Sampling", Graphics Gems IV, 1994): an edge parallel
        // to the pixel borders is resolved at sixteen positions and not only at four.
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
    let cast = cast(
        &edges.world,
        optics,
        plan,
        &bundle,
        edges.occluders,
        scratch,
    );
    let place = |lane: usize| {
        Place::new(
            &edges.world,
            cast.hits.surface[lane],
            (cast.lit[lane], cast.shaded.lamps[lane]),
            cast.hits.normal(lane).as_vec3(),
            directions[lane].as_vec3(),
            cast.shaded.point[2][lane] as f32,
        )
    };
    let places: [Place; LANES] = std::array::from_fn(place);
    // Only adjacent samples are compared, so that a curved surface does not count as an edge.
    let edge = (0..LANES).any(|lane| {
        let right = (lane % TILE + 1 < TILE).then_some(lane + 1);
        let below = (lane + TILE < LANES).then_some(lane + TILE);
        [right, below]
            .into_iter()
            .flatten()
            .any(|next| places[lane].is_apart(&places[next], edges.pixel_slope))
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
    // The footprint of a sample is a quarter of the pixel's footprint along each side.
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
