//! What surfaces look like beyond one albedo an object: done for the lanes that need it, after
//! [`shade`](super::shade) has lit all of them as white or as Lambertian surfaces.

mod ggx;
mod normals;

use super::shade::{Optics, Shaded};
use super::world::{Hits, Surface, World};
use super::{Plan, Term, lights};
use crate::geometry::raycast::LANES;
use crate::profile::Scene;
use ggx::Ggx;
use glam::{DVec3, Vec3};
use std::ops::Range;
use std::sync::Arc;

/// The looks of all objects.
pub(super) struct Looks {
    of: Vec<Look>,
}

struct Look {
    albedo: f64,
    specular: Option<Arc<Ggx>>,
    /// Of the object's first triangle among the world's.
    first_triangle: usize,
    /// Smooth normals at the corners of its triangles; empty where nothing needs them.
    normals: Vec<[Vec3; 3]>,
}

impl Looks {
    pub(super) fn new(scene: &Scene) -> Self {
        let mut made: Vec<(crate::profile::Specular, Arc<Ggx>)> = Vec::new();
        let mut material = |wanted: crate::profile::Specular| {
            if let Some((_, ggx)) = made.iter().find(|(had, _)| *had == wanted) {
                return ggx.clone();
            }
            let ggx = Arc::new(Ggx::new(wanted.f0, wanted.roughness));
            made.push((wanted, ggx.clone()));
            ggx
        };
        let looks = scene.object.iter().map(|object| Look {
            albedo: object.albedo,
            specular: object.specular.map(&mut material),
            first_triangle: 0,
            normals: Vec::new(),
        });
        Self {
            of: looks.collect(),
        }
    }

    /// Takes what an object's mesh, placed in the world, has to say; `range` is its triangles'.
    pub(super) fn mesh(
        &mut self,
        object: u16,
        range: Range<usize>,
        vertices: &[DVec3],
        triangles: &[[u32; 3]],
    ) {
        let look = &mut self.of[usize::from(object)];
        look.first_triangle = range.start;
        if look.specular.is_some() {
            look.normals = normals::corners(vertices, &triangles[range]);
        }
    }

    /// What a surface is first lit as: its albedo, or white where [`apply`] comes after.
    #[inline(always)]
    pub(super) fn first_albedo(&self, plan: &Plan, object: u16) -> f64 {
        let look = &self.of[usize::from(object)];
        if plan.has(Term::Specular) && look.specular.is_some() {
            return 1.0;
        }
        look.albedo
    }

    pub(super) fn any_specular(&self) -> bool {
        self.of.iter().any(|look| look.specular.is_some())
    }
}

/// Whether the plan has a term that [`apply`] computes.
pub(super) fn is_needed(plan: &Plan) -> bool {
    [Term::Specular, Term::Lights, Term::Flicker]
        .into_iter()
        .any(|term| plan.has(term))
}

/// A point of a surface as light finds it.
pub(super) struct Local<'a> {
    /// In the rig's frame in millimetres.
    pub(super) point: DVec3,
    /// Normal of the surface itself, on the camera's side.
    flat: DVec3,
    /// Normal that its light follows.
    normal: DVec3,
    /// Unit vector to the camera.
    view: DVec3,
    albedo: f64,
    specular: Option<&'a Ggx>,
}

impl<'a> Local<'a> {
    fn new(
        world: &'a World,
        plan: &Plan,
        direction: DVec3,
        hits: &Hits,
        shaded: &Shaded,
        lane: usize,
    ) -> Self {
        let surface = hits.surface[lane];
        let look = &world.looks.of[usize::from(world.object(surface))];
        let specular = look.specular.as_deref();
        let specular = specular.filter(|_| plan.has(Term::Specular));
        let point = DVec3::from_array(shaded.point.map(|axis| axis[lane]));
        let flat = hits.normal(lane);
        Self {
            point,
            flat,
            normal: match specular {
                Some(_) => look.normal(world, surface, point, flat),
                None => flat,
            },
            view: -direction.normalize(),
            albedo: look.albedo,
            specular,
        }
    }

    /// What the surface makes of 1 W/m^2 from a direction, relative to a white Lambertian one that
    /// faces it: reflectance times cosine, 0 from behind.
    pub(super) fn reflected(&self, towards: DVec3) -> f64 {
        if !(self.flat.dot(towards) > 0.0) {
            return 0.0;
        }
        let cos = self.normal.dot(towards).max(0.0);
        match self.specular {
            Some(ggx) => cos * ggx.reflectance(self.albedo, self.normal, towards, self.view),
            None => cos * self.albedo,
        }
    }
}

/// Reflects the light of lanes whose surfaces are more than one albedo, and adds the lamps'.
pub(super) fn apply(
    world: &World,
    optics: &Optics,
    plan: &Plan,
    directions: &[DVec3; LANES],
    hits: &Hits,
    shaded: &mut Shaded,
    stack: &mut Vec<(u32, f32)>,
) {
    let locals: [Option<Local<'_>>; LANES] = std::array::from_fn(|lane| {
        let hit = hits.is_hit(lane);
        hit.then(|| Local::new(world, plan, directions[lane], hits, shaded, lane))
    });
    for lane in 0..LANES {
        let Some(local) = &locals[lane] else { continue };
        let Some(ggx) = local.specular else { continue };
        // Lit as white so far, by the cosine at the facet.
        let light = (optics.projector.center() - local.point).normalize();
        let cos = local.flat.dot(light);
        shaded.projected[lane] *= if cos > 0.0 {
            local.reflected(light) / cos
        } else {
            0.0
        };
        let cos_view = local.normal.dot(local.view);
        shaded.ambient[lane] *= ggx.under_even_light(local.albedo, cos_view);
    }
    if plan.has(Term::Flicker) {
        shaded.flickering = shaded.ambient.map(|a| a * optics.ambient_depth);
    }
    if plan.has(Term::Lights) {
        let scale = optics.electrons_per_irradiance;
        lights::add(
            &optics.lamps,
            scale,
            world,
            plan,
            hits,
            &locals,
            shaded,
            stack,
        );
    }
}

impl Look {
    /// The normal that highlights follow, on the side of `flat`, the facet's.
    fn normal(&self, world: &World, surface: Surface, point: DVec3, flat: DVec3) -> DVec3 {
        let index = (surface.0 as usize).wrapping_sub(self.first_triangle);
        let (Some(normals), Some(corners)) = (self.normals.get(index), world.corners(surface))
        else {
            return flat;
        };
        let weights = barycentric(corners, point);
        let sum: DVec3 = (0..3).map(|i| normals[i].as_dvec3() * weights[i]).sum();
        let smooth = sum.try_normalize().unwrap_or(flat);
        if smooth.dot(flat) < 0.0 {
            -smooth
        } else {
            smooth
        }
    }
}

/// Weights of a triangle's corners at a point of its plane, not negative.
fn barycentric([a, b, c]: [DVec3; 3], point: DVec3) -> [f64; 3] {
    let normal = (b - a).cross(c - a);
    let area2 = normal.length_squared();
    if area2 == 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let share = |p: DVec3, q: DVec3| ((q - p).cross(point - p).dot(normal) / area2).max(0.0);
    let raw = [share(b, c), share(c, a), share(a, b)];
    let sum: f64 = raw.iter().sum();
    raw.map(|w| w / sum)
}
