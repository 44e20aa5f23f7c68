//! Materials beyond a constant albedo. Applied to the lanes that need it, after
//! [`shade`](super::shade) has lit all lanes as white or Lambertian surfaces.
//!
//! | module | contents |
//! | --- | --- |
//! | `ggx` | specular lobe over a diffuse base |
//! | `evenly` | total reflectance of a patch, for indirect light |
//! | `map` | spatially varying albedo: texture or board |
//! | `texture` | averages of a texture over footprints |
//! | `lay` | mapping of a texture onto a shape |
//! | `printed` | ink of calibration boards |
//! | `normals` | smooth normals of meshes |
//! | `spot` | the footprint of a pixel on a surface |

mod evenly;
mod ggx;
mod lay;
mod map;
mod normals;
mod printed;
mod spot;
mod texture;

use super::geometry::Bundle;
use super::shade::{Optics, Shaded};
use super::skin::Skins;
use super::world::{Hits, Surface, World};
use super::{Plan, Term, lamps};
pub(super) use evenly::{Evenly, Patch};
pub(super) use ggx::Ggx;
use glam::{DVec3, Vec3};
pub(super) use lay::Lay;
pub(super) use map::{ImageMap, Map, Place};
pub(super) use normals::Smoother;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::Mesh;
use phasmid_geometry::raycast::{LANES, Scratch};
use phasmid_profile::{Object, Scene, Shape, Specular};
pub(super) use printed::Printed;
pub(super) use spot::Spot;
use std::path::PathBuf;
use std::sync::Arc;
pub(super) use texture::{Texture, texels};

/// Materials of all objects.
pub(super) struct Materials {
    pub(super) of: Vec<Material>,
}

pub(super) struct Material {
    pub(super) albedo: f64,
    pub(super) specular: Option<Arc<Ggx>>,
    /// Whether to use the mesh's vertex colours.
    wants_colours: bool,
    pub(super) map: Option<Map>,
    /// Number of the object's first triangle in the world.
    pub(super) first_triangle: usize,
    /// Smooth normals at the corners of its triangles; empty if not needed.
    pub(super) normals: Vec<[Vec3; 3]>,
    /// Reflectances at the corners of its triangles; empty if all are 1.
    pub(super) colours: Vec<[f32; 3]>,
}

/// Cache of resources shared between objects.
#[derive(Default)]
struct Made {
    lobes: Vec<(Specular, Arc<Ggx>)>,
    textures: Vec<(PathBuf, Arc<Texture>)>,
}

impl Materials {
    /// Creates the materials of a scene's objects; mesh data is added by [`Self::mesh`].
    ///
    /// # Errors
    /// Returns an error if a texture cannot be read.
    pub(super) fn new(scene: &Scene, skins: &Skins) -> Result<Self> {
        let mut made = Made::default();
        let material = |(i, object): (usize, &Object)| {
            let map = match (&object.texture, &object.shape) {
                (None, &Shape::Board { board, ink }) => Some(Map::board(board, ink, scene, object)),
                (None, _) => None,
                (Some(file), _) => {
                    let place = || format!("scene, object[{i}].texture");
                    let read = made.texture(scene.folder.join(file));
                    Some(Map::image(read.map_err(|e| e.at(place()))?, scene, object))
                }
            };
            Ok(Material {
                // On skin the albedo scales the reflectance of the tissue.
                albedo: object.albedo * skins.reflectance(i).unwrap_or(1.0),
                specular: object.lobe().map(|specular| made.lobe(specular)),
                wants_colours: object.vertex_colours,
                map,
                first_triangle: 0,
                normals: Vec::new(),
                colours: Vec::new(),
            })
        };
        let of = scene.object.iter().enumerate().map(material);
        Ok(Self {
            of: of.collect::<Result<_>>()?,
        })
    }

    /// Stores the material data of an object's mesh. `vertices` are at rest in the rig's frame; the
    /// first of the object's triangles has the given number.
    ///
    /// # Errors
    /// Returns an error if the mesh lacks colours or texture coordinates that the scene requires.
    pub(super) fn mesh(
        &mut self,
        object: u16,
        first_triangle: usize,
        mesh: &Mesh,
        vertices: &[DVec3],
        triangles: &[[u32; 3]],
    ) -> Result<()> {
        let material = &mut self.of[usize::from(object)];
        material.first_triangle = first_triangle;
        if material.specular.is_some() {
            material.normals = Smoother::new(vertices, triangles).normals(vertices, triangles);
        }
        if material.wants_colours {
            if mesh.colours.is_empty() {
                return Err(Error::input(
                    "vertex_colours",
                    "a mesh without colours",
                    "a PLY file with red, green and blue, or an OBJ file with `v x y z r g b`",
                ));
            }
            let at = |t: &[u32; 3]| t.map(|i| mesh.colours[i as usize]);
            material.colours = mesh.triangles.iter().map(at).collect();
        }
        match &mut material.map {
            Some(map) => map.take(mesh),
            None => Ok(()),
        }
    }

    /// Returns the albedo for initial shading: that of the object, or 1 (white) if [`apply`] follows.
    #[inline(always)]
    pub(super) fn first_albedo(&self, plan: &Plan, object: u16) -> f64 {
        let material = &self.of[usize::from(object)];
        if material.is_finished_by_apply(plan) {
            1.0
        } else {
            material.albedo
        }
    }

    pub(super) fn any_specular(&self) -> bool {
        self.of.iter().any(|material| material.specular.is_some())
    }

    /// Returns whether an object's albedo varies over its surface.
    pub(super) fn vary(&self, object: u16) -> bool {
        self.of[usize::from(object)].varies()
    }

    /// Returns the number of objects.
    pub(super) fn len(&self) -> usize {
        self.of.len()
    }

    pub(super) fn any_map(&self) -> bool {
        self.of.iter().any(Material::varies)
    }
}

impl Made {
    fn lobe(&mut self, wanted: Specular) -> Arc<Ggx> {
        if let Some((_, ggx)) = self.lobes.iter().find(|(had, _)| *had == wanted) {
            return ggx.clone();
        }
        let ggx = Arc::new(Ggx::new(wanted.f0, wanted.roughness));
        self.lobes.push((wanted, ggx.clone()));
        ggx
    }

    fn texture(&mut self, path: PathBuf) -> Result<Arc<Texture>> {
        if let Some((_, texture)) = self.textures.iter().find(|(had, _)| *had == path) {
            return Ok(texture.clone());
        }
        let texture = Arc::new(Texture::read(&path)?);
        self.textures.push((path, texture.clone()));
        Ok(texture)
    }
}

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
pub(super) struct Local<'a> {
    /// In the rig's frame in millimetres.
    pub(super) point: DVec3,
    /// Normal of the surface itself, on the camera's side.
    flat: DVec3,
    /// Shading normal.
    normal: DVec3,
    /// Unit vector to the camera.
    view: DVec3,
    albedo: f64,
    specular: Option<&'a Ggx>,
    /// Whether it has been lit as white so far.
    is_white: bool,
    /// Relative correction of the projector's light for its gradient within the pixel.
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

    /// Returns the reflected light for 1 W/m^2 from a direction, relative to a white Lambertian
    /// surface that faces it: reflectance times cosine, 0 from behind.
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

    /// Applies the material to projector and ambient light that was computed for a white surface.
    fn finish(&self, projector: DVec3, shaded: &mut Shaded, lane: usize) {
        let Some(ggx) = self.specular else {
            shaded.projected[lane] *= self.albedo;
            shaded.ambient[lane] *= self.albedo;
            shaded.evenly[lane] *= self.albedo;
            return;
        };
        // The light so far contains the cosine at the facet.
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
        lamps::add(rays, &locals, shaded, scratch);
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
        // Sides of the footprint on the tangent plane, as in `shade`.
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
/// light across a footprint with the albedo given by `seen`: the sum over both sides of the light's
/// relative gradient times the albedo's first moment. On a plane, light falls with the cube of the
/// distance, since the cosine is the plane's distance from the projector over that distance. The
/// moment is estimated from halves of the footprint; averaged over edge positions these give 3/4 of
/// it. Without this an outline would shift by a twelfth of the gradient in pixels, about 1e-4,
/// which the mean over many dot centres would reveal.
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

/// Returns the offset from the point seen by a pixel's centre to the mean point seen by the pixel,
/// on a plane at this depth: the farther part of a footprint is larger. With p = depth(u) d(u) on
/// the plane and d linear in the pixel u, p'' = 2 (depth'/depth) p', and the mean over a pixel is
/// off by p''/24 along each side. It is about 1e-4 pixels, which the mean over many dot centres
/// would reveal.
fn footprint_shift(sides: [DVec3; 2], depth: f64) -> DVec3 {
    // Clamped for grazing footprints, for which the series does not hold.
    let shift = |side: DVec3| side * ((side.z / depth).clamp(-0.5, 0.5) / 12.0);
    shift(sides[0]) + shift(sides[1])
}

impl Material {
    /// Returns whether its albedo varies over the surface.
    fn varies(&self) -> bool {
        self.map.is_some() || self.wants_colours
    }

    fn is_finished_by_apply(&self, plan: &Plan) -> bool {
        plan.has(Term::Specular) && self.specular.is_some()
            || plan.has(Term::AlbedoMaps) && self.varies()
    }

    /// Returns the index of a surface among the object's triangles; out of range for solids.
    fn index(&self, surface: Surface) -> usize {
        (surface.0 as usize).wrapping_sub(self.first_triangle)
    }

    /// Returns the factor on the albedo.
    fn factor(
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

/// Weights of a triangle's corners at a point of its plane, not negative.
fn barycentric(corners: [DVec3; 3], point: DVec3) -> [f64; 3] {
    let raw = shares(corners, point - corners[0]);
    let raw = [1.0 + raw[0], raw[1], raw[2]].map(|w| w.max(0.0));
    let sum: f64 = raw.iter().sum();
    if sum > 0.0 {
        raw.map(|w| w / sum)
    } else {
        [1.0, 0.0, 0.0]
    }
}

/// Returns the change of the barycentric weights over a step in the triangle's plane; NaN if it is
/// degenerate.
fn shares([a, b, c]: [DVec3; 3], step: DVec3) -> [f64; 3] {
    let (e1, e2) = (b - a, c - a);
    let normal = e1.cross(e2);
    let area2 = normal.length_squared();
    let second = step.cross(e2).dot(normal) / area2;
    let third = e1.cross(step).dot(normal) / area2;
    [-second - third, second, third]
}
