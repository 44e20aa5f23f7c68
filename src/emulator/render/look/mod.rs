//! What surfaces look like beyond one albedo an object: done for the lanes that need it, after
//! [`shade`](super::shade) has lit all of them as white or as Lambertian surfaces.

mod ggx;
mod normals;

use super::shade::{Optics, Shaded};
use super::world::{Hits, Surface, World};
use super::{Plan, Term};
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
    plan.has(Term::Specular)
}

/// Reflects the light of lanes whose surfaces are more than one albedo; their rays start at `origin`.
pub(super) fn apply(
    world: &World,
    optics: &Optics,
    plan: &Plan,
    origin: DVec3,
    directions: &[DVec3; LANES],
    hits: &Hits,
    shaded: &mut Shaded,
) {
    for lane in (0..LANES).filter(|&lane| hits.is_hit(lane)) {
        let look = &world.looks.of[usize::from(world.object(hits.surface[lane]))];
        let Some(ggx) = look
            .specular
            .as_deref()
            .filter(|_| plan.has(Term::Specular))
        else {
            continue;
        };
        let point = origin + DVec3::from_array(shaded.point.map(|axis| axis[lane]));
        let flat = hits.normal(lane);
        let normal = look.normal(world, hits.surface[lane], point, flat);
        let view = -directions[lane].normalize();
        let light = (optics.projector.center() - point).normalize();
        // The irradiance of the smooth surface rather than the facet's.
        let cos = flat.dot(light);
        shaded.projected[lane] *= if cos > 0.0 {
            ggx.reflectance(look.albedo, normal, light, view) * normal.dot(light).max(0.0) / cos
        } else {
            0.0
        };
        shaded.ambient[lane] *= ggx.under_even_light(look.albedo, normal.dot(view));
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
