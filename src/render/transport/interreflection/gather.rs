//! Gathers indirect light at surface points: casts rays over the hemisphere and evaluates the light
//! at the points that they hit.

use super::hemisphere::{Hemisphere, Ray};
use super::patch::{Evenly, Patch, Shown, shown};
use crate::exposure::{BLOCK, GeometryBuffer, InterreflectionMap};
use crate::scene::{Surface, World, Worlds};
use crate::transport::rays::Rays;
use crate::{Plan, Term};
use glam::{DVec3, Vec3};
use phasmid_geometry::raycast::{LANES, Scratch};
use rayon::prelude::*;

/// Number of gather points per parallel task.
const TASK: usize = 64;

/// Gathers indirect light.
pub(super) struct Gatherer<'a> {
    worlds: &'a Worlds,
    rays: &'a Rays<'a>,
    plan: &'a Plan,
    hemisphere: Hemisphere,
    samples: f64,
}

/// A point at which light is gathered.
pub(super) struct Place<'w> {
    /// World at the instant of the point's row. In the world of another instant, the point's own
    /// surface may have moved in front of the point.
    world: &'w World,
    point: DVec3,
    normal: DVec3,
    own: Surface,
    /// Rotation of the rays about the normal.
    pub(super) turn: f64,
}

/// The patches that sixteen rays hit, with their materials.
type Met<'a> = [Option<(Patch, Evenly<'a>)>; LANES];

/// Result of one task: the rays that end in the projector's light, the number of these rays for each
/// point, and for each point the light of the lamps and its flicker amplitude.
#[derive(Default)]
struct Gathered {
    rays: Vec<[f32; 7]>,
    counts: Vec<usize>,
    lamps: Vec<[f32; 2]>,
}

impl<'a> Gatherer<'a> {
    pub(super) fn new(
        worlds: &'a Worlds,
        rays: &'a Rays<'a>,
        plan: &'a Plan,
        count: usize,
    ) -> Self {
        Self {
            worlds,
            rays,
            plan,
            hemisphere: Hemisphere::new(count),
            samples: count as f64,
        }
    }

    /// Gathers the light at the points that `pixels` see, in order; the light is zero for pixels
    /// that see no surface.
    pub(super) fn gather(
        &self,
        map: &GeometryBuffer,
        pixels: &[Option<usize>],
    ) -> InterreflectionMap {
        let tasks: Vec<Gathered> = pixels
            .par_chunks(TASK)
            .map_init(Scratch::default, |scratch, pixels| {
                let mut gathered = Gathered::default();
                for pixel in pixels {
                    let before = gathered.rays.len();
                    let mut lamps = [0.0; 2];
                    let wanted = pixel.filter(|_| !self.worlds.stop.is_asked());
                    if let Some(pixel) = wanted {
                        let world = self.worlds.at(pixel / map.width);
                        let place = self.place(&world, map, pixel);
                        self.point(&place, &mut gathered.rays, &mut lamps, scratch);
                    }
                    gathered.counts.push(gathered.rays.len() - before);
                    gathered.lamps.push(lamps.map(|w_m2| w_m2 as f32));
                }
                gathered
            })
            .collect();
        let mut interreflection = InterreflectionMap::default();
        for task in &tasks {
            let mut rays = task.rays.as_slice();
            for &count in &task.counts {
                let (own, rest) = rays.split_at(count);
                interreflection.push(own, self.plan);
                rays = rest;
            }
        }
        interreflection.lamps = tasks.into_iter().flat_map(|task| task.lamps).collect();
        interreflection
    }

    /// Returns the irradiance of a place in W/m^2 by the indirect light of the projector's full
    /// white.
    pub(super) fn white(&self, place: &Place<'_>, scratch: &mut Scratch) -> f64 {
        let mut kept = Vec::new();
        for rays in self.hemisphere.above(place.normal, place.turn) {
            let met = self.meet(place, &rays, scratch);
            self.projected(place.world, &met, &mut kept, scratch);
        }
        kept.iter().map(|ray| f64::from(ray[6])).sum()
    }

    /// Returns the irradiance of a place by light that has made one bounce more than the light of
    /// [`Self::white`]. The gatherer `white` computes the light at the points where the rays of this
    /// gatherer end.
    pub(super) fn second(&self, place: &Place<'_>, white: &Self, scratch: &mut Scratch) -> f64 {
        // The reflectance is taken at the mean cosine of uniform light.
        const COS: f64 = 2.0 / 3.0;
        let mut sum = 0.0;
        for rays in self.hemisphere.above(place.normal, place.turn) {
            for (patch, evenly) in self.meet(place, &rays, scratch).iter().flatten() {
                let hit = Place {
                    point: patch.point,
                    normal: patch.normal,
                    own: patch.surface,
                    ..*place
                };
                sum += evenly.share(COS) * white.white(&hit, scratch);
            }
        }
        sum / self.samples
    }

    pub(super) fn place<'w>(
        &self,
        world: &'w World,
        map: &GeometryBuffer,
        pixel: usize,
    ) -> Place<'w> {
        let width = map.width;
        let direction = self.rays.center(pixel % width, pixel / width);
        // The rays of neighbouring points are rotated differently, which decorrelates their
        // sampling errors. The angle comes from Knuth's multiplicative hash (TAOCP 3, section 6.4).
        let hash = (pixel as u32).wrapping_mul(2_654_435_769);
        Place {
            world,
            turn: f64::from(hash) / 4_294_967_296.0 * std::f64::consts::TAU,
            point: direction * f64::from(map.depth[pixel]),
            normal: Vec3::from_array(map.normal[pixel]).as_dvec3().normalize(),
            own: Surface(map.surface[pixel]),
        }
    }

    fn point(
        &self,
        place: &Place<'_>,
        kept: &mut Vec<[f32; 7]>,
        lamps: &mut [f64; 2],
        scratch: &mut Scratch,
    ) {
        for rays in self.hemisphere.above(place.normal, place.turn) {
            let met = self.meet(place, &rays, scratch);
            if met.iter().any(Option::is_some) {
                self.projected(place.world, &met, kept, scratch);
                if self.plan.has(Term::Lights) {
                    self.lamps(place.world, &met, lamps, scratch);
                }
            }
        }
    }

    /// Returns the patches that sixteen rays hit.
    fn meet<'w>(&self, place: &Place<'w>, rays: &[Ray; LANES], scratch: &mut Scratch) -> Met<'w> {
        let directions = std::array::from_fn(|lane| rays[lane].direction);
        let world = place.world;
        let hits = world.leaving(place.point, place.own, &directions, scratch);
        std::array::from_fn(|lane| {
            if !hits.is_hit(lane) {
                return None;
            }
            let (direction, normal, t) = (directions[lane], hits.normal(lane), hits.t[lane]);
            let facing = normal.dot(direction);
            // Projects a side of the ray's patch from the sphere onto the tangent plane, along the
            // ray.
            let onto = |side: DVec3| (side - direction * (normal.dot(side) / facing)) * t;
            let patch = Patch {
                point: place.point + direction * t,
                normal,
                surface: hits.surface[lane],
                sides: rays[lane].sides.map(onto),
            };
            let evenly = world.materials.evenly(self.plan, world, &patch);
            Some((patch, evenly))
        })
    }

    /// Keeps the rays whose hits are in the projector's light.
    fn projected(
        &self,
        world: &World,
        met: &Met<'_>,
        kept: &mut Vec<[f32; 7]>,
        scratch: &mut Scratch,
    ) {
        let optics = self.rays.optics;
        let mut found: [Option<Shown>; LANES] = std::array::from_fn(|lane| {
            let (patch, evenly) = met[lane].as_ref()?;
            shown(optics, self.plan, patch, evenly).filter(|shown| shown.thrown_back > 0.0)
        });
        if self.plan.has(Term::Shadows) && found.iter().any(Option::is_some) {
            let points = points(met, |lane| found[lane].is_some());
            let pupil = optics.projector.center();
            let blocked = world.blocked(pupil, &points, scratch);
            for lane in (0..LANES).filter(|&lane| blocked[lane]) {
                found[lane] = None;
            }
        }
        for (found, met) in found.iter().zip(met) {
            let (Some(shown), Some((patch, _))) = (found, met) else {
                continue;
            };
            let blur = if self.plan.has(Term::ProjectorDefocus) {
                f64::from(optics.blur_px(patch.point))
            } else {
                0.0
            };
            let [x, y] = [(0, blur), (1, blur * optics.defocus.aspect)]
                .map(|(axis, blur)| shown.sides.map(|side| widened(side[axis], blur)));
            let weight = shown.thrown_back / self.samples;
            let ray = [shown.px.x, x[0], x[1], shown.px.y, y[0], y[1], weight];
            kept.push(ray.map(|value| value as f32));
        }
    }

    /// Adds the lamps' light carried by the rays, and its flicker amplitude.
    fn lamps(&self, world: &World, met: &Met<'_>, sum: &mut [f64; 2], scratch: &mut Scratch) {
        for lamp in &self.rays.optics.lamps {
            let thrown_back: [f64; LANES] = std::array::from_fn(|lane| {
                met[lane].as_ref().map_or(0.0, |(patch, evenly)| {
                    let (towards, irradiance) = lamp.seen_from(patch.point);
                    let cos = patch.normal.dot(towards);
                    if cos > 0.0 {
                        irradiance * cos * evenly.share(cos)
                    } else {
                        0.0
                    }
                })
            });
            let points = points(met, |lane| thrown_back[lane] > 0.0);
            let mut blocked = [false; LANES];
            if self.plan.has(Term::Shadows) && points.iter().any(Option::is_some) {
                blocked = lamp.blocked(world, &points, scratch);
            }
            for lane in (0..LANES).filter(|&lane| !blocked[lane]) {
                let brought = thrown_back[lane] / self.samples;
                sum[0] += brought;
                sum[1] += brought * lamp.depth;
            }
        }
    }
}

/// Returns the hits that a light source may reach, as targets of the light's shadow rays.
fn points(met: &Met<'_>, wanted: impl Fn(usize) -> bool) -> [Option<(DVec3, Surface)>; LANES] {
    std::array::from_fn(|lane| {
        let (patch, _) = met[lane].as_ref().filter(|_| wanted(lane))?;
        Some((patch.point, patch.surface))
    })
}

/// Widens one of the two boxes of a footprint by half of a blur's variance; a box of width w has
/// variance w^2 / 12.
fn widened(side: f64, blur: f64) -> f64 {
    if blur > 0.0 {
        side.hypot(blur * 6f64.sqrt()).copysign(side)
    } else {
        side
    }
}

impl InterreflectionMap {
    /// Adds a gather point with its rays, keeping only the data that the plan needs.
    fn push(&mut self, rays: &[[f32; 7]], plan: &Plan) {
        for block in rays.chunks(BLOCK) {
            let of = |field: usize| -> [f32; BLOCK] {
                std::array::from_fn(|lane| block.get(lane).map_or(0.0, |ray| ray[field]))
            };
            let slopes = |field: usize| -> [[f32; 2]; BLOCK] {
                let (a, b) = (of(field), of(field + 1));
                std::array::from_fn(|lane| [a[lane], b[lane]])
            };
            if plan.has(Term::FootprintX) {
                self.x.push(of(0));
                self.x_slope.push(slopes(1));
            }
            if plan.has(Term::FootprintY) {
                self.y.push(of(3));
                self.y_slope.push(slopes(4));
            }
            self.weight.push(of(6));
        }
        self.ends.push(self.weight.len() as u32);
        self.white.push(rays.iter().map(|ray| ray[6]).sum());
    }
}
