//! A scene made ready for rays: closed-form solids, and all meshes in one hierarchy, in the rig's
//! frame.

use super::look::Looks;
use super::shade::Wide;
use crate::error::{Error, Result};
use crate::geometry::raycast::{Bvh, LANES, NO_TRIANGLE, Packet, Parallel};
use crate::geometry::{Mesh, Pose, Solid, shapes};
use crate::profile::{Object, Scene, Shape};
use glam::{DVec2, DVec3, Vec3};
use std::path::Path;

/// Shadow rays end this fraction before their point, so that the f32 error of a neighbouring
/// triangle (some 1e-7 of the distance) does not shade it: 10 um at 1 m.
const SHADOW_END: f32 = 1.0 - 1e-5;
/// The same for solids, whose intersection is in f64.
const SHADOW_END_SOLID: f64 = 1.0 - 1e-9;
/// Most triangles of a scene: some 10 GiB with their hierarchy.
const MAX_TRIANGLES: usize = 50_000_000;
/// Facets that a solid may have.
const FACETS: u32 = 8;

/// A smooth piece of surface: a triangle, or a facet of a solid. All of the world's are numbered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Surface(pub(super) u32);

impl Surface {
    /// No surface.
    pub(super) const NONE: Self = Self(u32::MAX);
}

/// Where sixteen rays from the camera meet the world.
pub(super) struct Hits {
    /// Ray parameter, with directions of z = 1 the depth; infinite where there is no surface.
    pub(super) t: Wide,
    /// Unit normals on the rays' side, an array a component.
    pub(super) normal: [Wide; 3],
    pub(super) surface: [Surface; LANES],
}

impl Hits {
    fn none() -> Self {
        Self {
            t: [f64::INFINITY; LANES],
            normal: [[0.0; LANES]; 3],
            surface: [Surface::NONE; LANES],
        }
    }

    pub(super) fn is_hit(&self, lane: usize) -> bool {
        self.surface[lane] != Surface::NONE
    }

    pub(super) fn normal(&self, lane: usize) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|axis| self.normal[axis][lane]))
    }

    /// Takes a hit, with its normal turned to the ray's side.
    fn set(&mut self, lane: usize, t: f64, normal: DVec3, direction: DVec3, surface: Surface) {
        let normal = if normal.dot(direction) > 0.0 {
            -normal
        } else {
            normal
        };
        self.t[lane] = t;
        for axis in 0..3 {
            self.normal[axis][lane] = normal[axis];
        }
        self.surface[lane] = surface;
    }
}

struct Placed {
    solid: Solid,
    rig_from_solid: Pose,
    solid_from_rig: Pose,
    object: u16,
    /// The camera is inside and sees the inner wall, which the outer one shades.
    around_camera: bool,
}

/// All surfaces.
pub(super) struct World {
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// Object of each triangle.
    owner: Vec<u16>,
    bvh: Bvh,
    solids: Vec<Placed>,
    /// What the objects' surfaces look like.
    pub(super) looks: Looks,
}

impl World {
    pub(super) fn new(scene: &Scene) -> Result<Self> {
        let mut world = Self {
            vertices: Vec::new(),
            triangles: Vec::new(),
            owner: Vec::new(),
            bvh: Bvh::default(),
            solids: Vec::new(),
            looks: Looks::new(scene)?,
        };
        for (i, object) in scene.object.iter().enumerate() {
            world.add(object, i as u16, &scene.folder)?;
        }
        world.bvh = Bvh::build(&world.vertices, &world.triangles);
        Ok(world)
    }

    fn add(&mut self, object: &Object, index: u16, folder: &Path) -> Result<()> {
        let pose = object.rig_from_object();
        match solid(&object.shape, object.scale) {
            Some(solid) => self.solids.push(Placed {
                solid,
                rig_from_solid: pose,
                solid_from_rig: pose.inverse(),
                object: index,
                around_camera: solid.contains(pose.inverse().translation_mm),
            }),
            None => {
                let place = || format!("scene, object[{index}].shape");
                let mesh = mesh(&object.shape, folder).map_err(|e| e.at(place()))?;
                let total = self.triangles.len() + mesh.triangles.len();
                if total > MAX_TRIANGLES {
                    return Err(Error::input(
                        place(),
                        format!("{total} triangles with those before it"),
                        format!("up to {MAX_TRIANGLES} triangles in a scene"),
                    ));
                }
                let first = self.vertices.len() as u32;
                let placed = mesh.vertices.iter().map(|&v| pose.point(v * object.scale));
                self.vertices.extend(placed);
                let shifted = mesh.triangles.iter().map(|t| t.map(|i| i + first));
                self.triangles.extend(shifted);
                let range = self.triangles.len() - mesh.triangles.len()..self.triangles.len();
                self.looks
                    .mesh(index, range, &mesh, &self.vertices, &self.triangles)
                    .map_err(|e| e.at(format!("scene, object[{index}]")))?;
                self.owner.resize(self.triangles.len(), index);
            }
        }
        Ok(())
    }

    pub(super) fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// Whether some surface may stand in the light of another, or of itself: one convex solid, seen
    /// from outside, shades itself only by facing away.
    pub(super) fn casts_shadows(&self) -> bool {
        !self.triangles.is_empty()
            || self.solids.len() > 1
            || self.solids.iter().any(|s| s.around_camera)
    }

    /// Whether a surface belongs to a mesh: neighbours of one mesh may form one smooth surface.
    pub(super) fn is_triangle(&self, surface: Surface) -> bool {
        (surface.0 as usize) < self.triangles.len()
    }

    /// The object that a surface belongs to.
    pub(super) fn object(&self, surface: Surface) -> u16 {
        match self.owner.get(surface.0 as usize) {
            Some(&object) => object,
            None => self.solids[self.solid_of(surface)].object,
        }
    }

    /// The corners of a surface that is a triangle.
    pub(super) fn corners(&self, surface: Surface) -> Option<[DVec3; 3]> {
        let triangle = self.triangles.get(surface.0 as usize)?;
        Some(triangle.map(|i| self.vertices[i as usize]))
    }

    fn solid_of(&self, surface: Surface) -> usize {
        (surface.0 as usize - self.triangles.len()) / FACETS as usize
    }

    /// The nearest surface along each ray from the camera's pupil, the rig's origin.
    pub(super) fn nearest(
        &self,
        directions: &[DVec3; LANES],
        used: &[bool; LANES],
        stack: &mut Vec<(u32, f32)>,
    ) -> Hits {
        let mut hits = Hits::none();
        if !self.bvh.is_empty() {
            let ends = used.map(|u| if u { f32::INFINITY } else { -1.0 });
            let mut packet = Packet::new(Vec3::ZERO, &directions.map(|d| d.as_vec3()), &ends);
            self.bvh.nearest(&mut packet, stack);
            for lane in 0..LANES {
                if packet.triangle[lane] != NO_TRIANGLE {
                    let rough = f64::from(packet.t[lane]);
                    self.on_triangle(packet.triangle[lane], directions, rough, lane, &mut hits);
                }
            }
        }
        for (i, placed) in self.solids.iter().enumerate() {
            let origin = placed.solid_from_rig.translation_mm;
            let first = self.triangles.len() as u32 + i as u32 * FACETS;
            for lane in (0..LANES).filter(|&lane| used[lane]) {
                let direction = directions[lane];
                let local = placed.solid_from_rig.direction(direction);
                if let Some(found) = placed.solid.intersect(origin, local, 0.0)
                    && found.t < hits.t[lane]
                {
                    let normal = placed.rig_from_solid.direction(found.normal);
                    let surface = Surface(first + found.facet);
                    hits.set(lane, found.t, normal, direction, surface);
                }
            }
        }
        hits
    }

    /// Solves the hit again in f64, on the plane of the triangle that the f32 traversal chose.
    fn on_triangle(
        &self,
        id: u32,
        directions: &[DVec3; LANES],
        rough: f64,
        lane: usize,
        hits: &mut Hits,
    ) {
        let direction = directions[lane];
        let [a, b, c] = self.triangles[id as usize].map(|i| self.vertices[i as usize]);
        let Some(normal) = (b - a).cross(c - a).try_normalize() else {
            return;
        };
        let t = normal.dot(a) / normal.dot(direction);
        // Edge-on, the plane says nothing; what f32 found is as good as it gets.
        let t = if (t - rough).abs() <= 1e-3 * rough {
            t
        } else {
            rough
        };
        hits.set(lane, t, normal, direction, Surface(id));
    }

    /// Whether something stands between the projector's pupil and each point; lanes with no point
    /// are not asked.
    pub(super) fn blocked(
        &self,
        pupil: DVec3,
        points: &[Option<(DVec3, Surface)>; LANES],
        stack: &mut Vec<(u32, f32)>,
    ) -> [bool; LANES] {
        let mut blocked = [false; LANES];
        if !self.bvh.is_empty() {
            let towards = points.map(|p| p.map_or(Vec3::ZERO, |(p, _)| (p - pupil).as_vec3()));
            let ends = points.map(|p| if p.is_some() { SHADOW_END } else { -1.0 });
            let mut packet = Packet::new(pupil.as_vec3(), &towards, &ends);
            packet.triangle = points.map(|p| p.map_or(NO_TRIANGLE, |(_, surface)| surface.0));
            self.bvh.blocked(&mut packet, stack);
            for lane in 0..LANES {
                blocked[lane] = points[lane].is_some() && packet.t[lane] < 0.0;
            }
        }
        for placed in &self.solids {
            let origin = placed.solid_from_rig.point(pupil);
            for lane in 0..LANES {
                let Some((point, surface)) = points[lane] else {
                    continue;
                };
                // Seen from outside, a convex solid shades itself only by facing away.
                let own = self.object(surface) == placed.object && !placed.around_camera;
                if blocked[lane] || own {
                    continue;
                }
                let direction = placed.solid_from_rig.direction(point - pupil);
                blocked[lane] = placed
                    .solid
                    .intersect(origin, direction, 0.0)
                    .is_some_and(|hit| hit.t < SHADOW_END_SOLID);
            }
        }
        blocked
    }
}

impl World {
    /// Whether something stands between each point and a light far away; lanes with no point are
    /// not asked. Rays start as far from their surface as [`SHADOW_END`] ends them.
    pub(super) fn blocked_along(
        &self,
        towards: DVec3,
        points: &[Option<(DVec3, Surface)>; LANES],
        stack: &mut Vec<(u32, f32)>,
    ) -> [bool; LANES] {
        let mut blocked = if self.bvh.is_empty() {
            [false; LANES]
        } else {
            let rays = points.map(|lane| {
                let (point, surface) = lane?;
                let start = point.length() as f32 * (1.0 - SHADOW_END);
                Some((point.as_vec3(), start, surface.0))
            });
            let rays = Parallel::new(towards.as_vec3(), &rays);
            self.bvh.blocked_along(rays, stack)
        };
        for placed in &self.solids {
            let direction = placed.solid_from_rig.direction(towards);
            for lane in 0..LANES {
                let Some((point, surface)) = points[lane] else {
                    continue;
                };
                let own = self.object(surface) == placed.object && !placed.around_camera;
                if blocked[lane] || own {
                    continue;
                }
                let origin = placed.solid_from_rig.point(point);
                let start = point.length() * (1.0 - SHADOW_END_SOLID);
                blocked[lane] = placed.solid.intersect(origin, direction, start).is_some();
            }
        }
        blocked
    }
}

/// The closed form of a shape, scaled; `None` for meshes.
fn solid(shape: &Shape, scale: f64) -> Option<Solid> {
    Some(match *shape {
        Shape::Plane { size_mm } => Solid::Plane {
            half: size_mm.map_or(DVec2::INFINITY, |s| DVec2::from_array(s) * scale / 2.0),
        },
        Shape::Sphere { radius_mm } => Solid::Sphere {
            radius: radius_mm * scale,
        },
        Shape::Cylinder {
            radius_mm,
            length_mm,
        } => Solid::Cylinder {
            radius: radius_mm * scale,
            half_length: length_mm * scale / 2.0,
        },
        Shape::Frustum {
            base_mm,
            top_mm,
            height_mm,
        } => Solid::frustum(base_mm * scale, top_mm * scale, height_mm * scale),
        Shape::Torso { .. } | Shape::Couch {} | Shape::Mesh { .. } => return None,
    })
}

/// The triangles of a shape that has no closed form.
pub(super) fn mesh(shape: &Shape, folder: &Path) -> Result<Mesh> {
    match *shape {
        Shape::Torso {
            seed,
            length_mm,
            width_mm,
            depth_mm,
            triangles,
        } => Ok(shapes::torso(&shapes::Torso {
            seed,
            length_mm,
            width_mm,
            depth_mm,
            triangles,
        })),
        Shape::Couch {} => Ok(shapes::couch(&shapes::Couch::default())),
        Shape::Mesh { ref file } => Mesh::read(&folder.join(file)),
        Shape::Plane { .. }
        | Shape::Sphere { .. }
        | Shape::Cylinder { .. }
        | Shape::Frustum { .. } => Ok(Mesh::default()),
    }
}
