//! Reflection at the points that sixteen camera rays hit: materials beyond a constant albedo, and
//! the light of lamps. It is applied to the lanes that need it, after [`Optics::shade`] has lit all
//! lanes as if their surfaces were white or Lambertian.

use super::rays::Bundle;
use crate::exposure::Optics;
use crate::material::{Ggx, Material, Spot, barycentric};
use crate::scene::{Hits, Shaded, Surface, World};
use crate::{Plan, Term};
use glam::DVec3;
use phasmid_geometry::raycast::{LANES, Scratch};

/// Returns whether the plan has a term that [`apply`] computes.
pub(super) fn is_needed(plan: &Plan) -> bool {
    [
        Term::AlbedoMaps,
        Term::Specular,
        Term::Lights,
        Term::Flicker,
    ]
    .into_iter()
    .any(|term| plan.has(term))
}

/// Sixteen cast camera rays.
pub(super) struct Rays<'a> {
    pub(super) world: &'a World,
    pub(super) optics: &'a Optics,
    pub(super) plan: &'a Plan,
    pub(super) bundle: &'a Bundle,
    pub(super) hits: &'a Hits,
}

/// A surface point to be lit.
struct Local<'a> {
    /// Point in the rig's frame in millimetres.
    point: DVec3,
    /// Normal of the facet, on the camera's side.
    flat: DVec3,
    /// Shading normal, which is smooth on meshes with smooth normals.
    normal: DVec3,
    /// Unit vector to the camera.
    view: DVec3,
    albedo: f64,
    specular: Option<&'a Ggx>,
    /// Whether the light computed so far assumes a white surface.
    is_white: bool,
    /// Relative correction of the projector's light for the gradient of that light within the pixel.
    slant: f64,
}

impl<'a> Local<'a> {
    fn new(rays: &Rays<'a>, shaded: &Shaded, lane: usize) -> Self {
        let (world, plan) = (rays.world, rays.plan);
        let surface = rays.hits.surface[lane];
        let material = &world.materials.of[usize::from(world.object(surface))];
        let specular = material.specular.as_deref();
        let specular = specular.filter(|_| plan.has(Term::Specular));
        let point = rays.bundle.origin + DVec3::from_array(shaded.point.map(|axis| axis[lane]));
        let flat = rays.hits.normal(lane);
        Self {
            point,
            flat,
            normal: match specular {
                Some(_) => material.normal(world, surface, point, flat),
                None => flat,
            },
            view: -rays.bundle.directions[lane].normalize(),
            albedo: material.albedo,
            specular,
            is_white: material.is_finished_by_apply(plan),
            slant: 0.0,
        }
    }

    /// Returns the reflected light for 1 W/m^2 from the direction `towards`, relative to a white
    /// Lambertian surface that faces this direction: reflectance times cosine, or 0 for light from
    /// behind.
    fn reflected(&self, towards: DVec3) -> f64 {
        if !(self.flat.dot(towards) > 0.0) {
            return 0.0;
        }
        let cos = self.normal.dot(towards).max(0.0);
        match self.specular {
            Some(ggx) => cos * ggx.reflectance(self.albedo, self.normal, towards, self.view),
            None => cos * self.albedo,
        }
    }

    /// Applies the material to projector and ambient light that have been computed for a white
    /// surface.
    fn finish(&self, projector: DVec3, shaded: &mut Shaded, lane: usize) {
        let Some(ggx) = self.specular else {
            shaded.projected[lane] *= self.albedo;
            shaded.ambient[lane] *= self.albedo;
            shaded.evenly[lane] *= self.albedo;
            return;
        };
        // The light computed so far contains the cosine to the facet's normal.
        let light = (projector - self.point).normalize();
        let cos = self.flat.dot(light);
        shaded.projected[lane] *= if cos > 0.0 {
            self.reflected(light) / cos
        } else {
            0.0
        };
        let cos_view = self.normal.dot(self.view);
        let reflected = ggx.under_even_light(self.albedo, cos_view);
        shaded.ambient[lane] *= reflected;
        shaded.evenly[lane] *= reflected;
    }
}

/// Applies the materials of lanes that have more than a constant albedo, and adds the lamps' light.
pub(super) fn apply(rays: &Rays<'_>, shaded: &mut Shaded, scratch: &mut Scratch) {
    let mut locals: [Option<Local<'_>>; LANES] = std::array::from_fn(|lane| {
        let hit = rays.hits.is_hit(lane);
        hit.then(|| Local::new(rays, shaded, lane))
    });
    if rays.plan.has(Term::AlbedoMaps) {
        vary(rays, &mut locals);
    }
    let projector = rays.optics.projector.center();
    for lane in 0..LANES {
        if let Some(local) = locals[lane].as_ref().filter(|local| local.is_white) {
            local.finish(projector, shaded, lane);
            shaded.projected[lane] *= 1.0 + local.slant;
        }
    }
    if rays.plan.has(Term::Flicker) {
        shaded.flickering = shaded.ambient.map(|a| a * rays.optics.ambient_depth);
    }
    if rays.plan.has(Term::Lights) {
        add_lamps(rays, &locals, shaded, scratch);
    }
}

/// Multiplies albedos by vertex colours and textures.
fn vary(rays: &Rays<'_>, locals: &mut [Option<Local<'_>>; LANES]) {
    let slopes = rays.optics.ray_slopes(rays.plan, &rays.bundle.directions);
    for lane in 0..LANES {
        let Some(local) = &mut locals[lane] else {
            continue;
        };
        let surface = rays.hits.surface[lane];
        let material = &rays.world.materials.of[usize::from(rays.world.object(surface))];
        if !material.varies() {
            continue;
        }
        // Sides of the pixel's footprint on the tangent plane, as in `shade`.
        let (direction, t) = (rays.bundle.directions[lane], rays.hits.t[lane]);
        let facing = local.flat.dot(direction);
        let sides = [0, 1].map(|by| {
            let step = DVec3::new(slopes[0][by][lane], slopes[1][by][lane], 0.0) * t;
            (step - direction * (local.flat.dot(step) / facing)) * rays.bundle.cell
        });
        let middle = local.point + footprint_shift(sides, t);
        let seen = |point, sides| material.factor(rays.world, surface, point, local.flat, sides);
        let factor = seen(middle, sides);
        if material.map.as_ref().is_some_and(|map| map.is_edge(factor)) {
            let way = rays.optics.projector.center() - local.point;
            local.slant = slant(way, middle, sides, seen) / factor;
        }
        local.albedo *= factor;
    }
}

/// Returns the relative change of the mean reflected light due to the gradient of the projector's
/// light across a footprint whose albedo is given by `seen`. It is the sum, over both sides of the
/// footprint, of the relative gradient of the light times the first moment of the albedo. On a
/// plane, light falls with the cube of the distance, since the cosine is the plane's distance from
/// the projector divided by the point's distance. The moment is estimated from halves of the
/// footprint; averaged over edge positions these give 3/4 of it. Without this correction an outline
/// would shift by a twelfth of the gradient in pixels, about 1e-4, which the mean over many dot
/// centres would reveal.
fn slant(
    way: DVec3,
    middle: DVec3,
    sides: [DVec3; 2],
    seen: impl Fn(DVec3, [DVec3; 2]) -> f64,
) -> f64 {
    let slope = way * (3.0 / way.length_squared());
    let along = |k: usize| {
        let mut half = sides;
        half[k] /= 2.0;
        let step = sides[k] / 4.0;
        slope.dot(sides[k]) * (seen(middle + step, half) - seen(middle - step, half)) / 6.0
    };
    along(0) + along(1)
}

/// Returns the offset from the point that a pixel's centre sees to the mean point that the pixel
/// sees, on a plane at this depth: the farther half of a footprint is larger. With p = depth(u) d(u)
/// on the plane and d linear in the pixel coordinate u, p'' = 2 (depth'/depth) p', so the mean over
/// a pixel differs from its centre by p''/24 along each side. The offset is about 1e-4 pixels, which
/// the mean over many dot centres would reveal.
fn footprint_shift(sides: [DVec3; 2], depth: f64) -> DVec3 {
    // Clamped for footprints at grazing angles, for which the series does not hold.
    let shift = |side: DVec3| side * ((side.z / depth).clamp(-0.5, 0.5) / 12.0);
    shift(sides[0]) + shift(sides[1])
}

/// Adds the light of all lamps; sets a bit in `Shaded::lamps` for each lamp that lights a lane.
fn add_lamps(
    rays: &Rays<'_>,
    locals: &[Option<Local<'_>>; LANES],
    shaded: &mut Shaded,
    scratch: &mut Scratch,
) {
    let scale = rays.optics.electrons_per_irradiance;
    for (i, lamp) in rays.optics.lamps.iter().enumerate() {
        let mut reflected = [0.0; LANES];
        let mut points = [None; LANES];
        for lane in 0..LANES {
            let Some(local) = &locals[lane] else { continue };
            let (towards, irradiance) = lamp.seen_from(local.point);
            let light = scale * irradiance * local.reflected(towards);
            if light > 0.0 {
                reflected[lane] = light;
                points[lane] = Some((local.point, rays.hits.surface[lane]));
            }
        }
        if points.iter().all(Option::is_none) {
            continue;
        }
        if rays.plan.has(Term::Shadows) {
            let blocked = lamp.blocked(rays.world, &points, scratch);
            for lane in (0..LANES).filter(|&lane| blocked[lane]) {
                points[lane] = None;
            }
        }
        for lane in (0..LANES).filter(|&lane| points[lane].is_some()) {
            shaded.ambient[lane] += reflected[lane];
            shaded.flickering[lane] += lamp.depth * reflected[lane];
            shaded.lamps[lane] |= 1 << i;
        }
    }
}

impl Material {
    /// Returns the index of a surface among the object's triangles; out of range for solids.
    fn index(&self, surface: Surface) -> usize {
        (surface.0 as usize).wrapping_sub(self.first_triangle)
    }

    /// Returns the factor by which the object's albedo is multiplied at a point.
    pub(super) fn factor(
        &self,
        world: &World,
        surface: Surface,
        point: DVec3,
        flat: DVec3,
        sides: [DVec3; 2],
    ) -> f64 {
        let corners = world.corners(surface);
        let index = self.index(surface);
        let spot = Spot {
            corners,
            point,
            normal: flat,
            sides,
        };
        let spot = world.at_rest(surface, spot);
        let mut factor = 1.0;
        if let (Some(colours), Some(corners)) = (self.colours.get(index), spot.corners) {
            let weights = barycentric(corners, spot.point);
            factor = (0..3).map(|i| f64::from(colours[i]) * weights[i]).sum();
        }
        if let Some(map) = &self.map {
            factor *= map.albedo(index, &spot);
        }
        factor
    }

    /// Returns the shading normal, on the side of the facet normal `flat`.
    fn normal(&self, world: &World, surface: Surface, point: DVec3, flat: DVec3) -> DVec3 {
        let normals = self.normals.get(self.index(surface));
        let (Some(normals), Some(corners)) = (normals, world.corners(surface)) else {
            return flat;
        };
        let weights = barycentric(corners, point);
        let normals = world.smooth(surface, normals.map(|n| n.as_dvec3()));
        let sum: DVec3 = (0..3).map(|i| normals[i] * weights[i]).sum();
        let smooth = sum.try_normalize().unwrap_or(flat);
        if smooth.dot(flat) < 0.0 {
            -smooth
        } else {
            smooth
        }
    }
}
