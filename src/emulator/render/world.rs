//! A scene made ready for rays: closed-form solids, and all meshes in one hierarchy, in the rig's
//! frame.

mod leaving;

use super::look::Looks;
use super::shade::Wide;
use super::shape::{mesh, solid};
use super::triangle::Triangle;
use crate::error::{Error, Result};
use crate::geometry::raycast::{Bvh, LANES, NO_TRIANGLE, Packet, Parallel, Scratch};
use crate::geometry::{Pose, Solid};
use crate::profile::{Object, Scene};
use glam::{DVec3, Vec3};

/// What stands this fraction before a point's end of a shadow ray touches the point rather than
/// shades it: 1 nm at 1 m, far above the error of f64.
pub(super) const SHADOW_END: f64 = 1.0 - 1e-9;
/// Where parallel rays start, relative to their point's distance from the rig, so that the f32
/// error of a neighbouring triangle (some 1e-7 of it) does not shade the point: 10 um at 1 m.
const OFF_POINT: f32 = 1e-5;
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
    pub(super) fn set(
        &mut self,
        lane: usize,
        t: f64,
        normal: DVec3,
        direction: DVec3,
        surface: Surface,
    ) {
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
            world.add(scene, object, i as u16)?;
        }
        world.bvh = Bvh::build(&world.vertices, &world.triangles);
        Ok(world)
    }

    fn add(&mut self, scene: &Scene, object: &Object, index: u16) -> Result<()> {
        let pose = scene.rig_from_object(object);
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
                let mesh = mesh(&object.shape, &scene.folder).map_err(|e| e.at(place()))?;
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

    /// The nearest surface along each ray from a point of the camera's pupil, which lies about the
    /// rig's origin; directions have z = 1.
    pub(super) fn nearest(
        &self,
        origin: DVec3,
        directions: &[DVec3; LANES],
        used: &[bool; LANES],
        scratch: &mut Scratch,
    ) -> Hits {
        let mut hits = Hits::none();
        if !self.bvh.is_empty() {
            let ends = used.map(|u| if u { f32::INFINITY } else { -1.0 });
            let rounded = directions.map(|d| d.as_vec3());
            let mut packet = Packet::new(origin.as_vec3(), &rounded, &ends);
            self.bvh.nearest(&mut packet, scratch);
            for lane in 0..LANES {
                if packet.triangle[lane] != NO_TRIANGLE {
                    let triangle = self.triangle(packet.triangle[lane], origin);
                    triangle.take(directions[lane], lane, &mut hits);
                }
            }
            for &(lane, id) in &scratch.rivals {
                let found = self.triangle(hits.surface[lane].0, origin);
                let rival = self.triangle(id, origin);
                rival.take_from(&found, directions[lane], lane, &mut hits);
            }
        }
        for (i, placed) in self.solids.iter().enumerate() {
            let origin = placed.solid_from_rig.point(origin);
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

    fn triangle(&self, id: u32, origin: DVec3) -> Triangle {
        let corner = |i: u32| self.vertices[i as usize] - origin;
        Triangle {
            id,
            corners: self.triangles[id as usize].map(corner),
        }
    }

    /// Whether something stands between the projector's pupil and each point; lanes with no point
    /// are not asked.
    pub(super) fn blocked(
        &self,
        pupil: DVec3,
        points: &[Option<(DVec3, Surface)>; LANES],
        scratch: &mut Scratch,
    ) -> [bool; LANES] {
        let mut blocked = [false; LANES];
        if !self.bvh.is_empty() {
            let towards = points.map(|p| p.map_or(Vec3::ZERO, |(p, _)| (p - pupil).as_vec3()));
            let ends = points.map(|p| if p.is_some() { 1.0 } else { -1.0 });
            let mut packet = Packet::new(pupil.as_vec3(), &towards, &ends);
            packet.triangle = points.map(|p| p.map_or(NO_TRIANGLE, |(_, surface)| surface.0));
            self.bvh.blocked(&mut packet, scratch);
            for lane in 0..LANES {
                blocked[lane] = points[lane].is_some() && packet.t[lane] < 0.0;
            }
            for &(lane, id) in &scratch.rivals {
                if let (Some((point, _)), false) = (points[lane], blocked[lane]) {
                    blocked[lane] = self.triangle(id, pupil).stands_before(point - pupil);
                }
            }
        }
        self.solids_between(points, &mut blocked, |placed, point| {
            let origin = placed.solid_from_rig.point(pupil);
            let direction = placed.solid_from_rig.direction(point - pupil);
            let hit = placed.solid.intersect(origin, direction, 0.0);
            hit.is_some_and(|hit| hit.t < SHADOW_END)
        });
        blocked
    }

    /// Adds the points that solids shade, where `shades` tells it of one solid and one point.
    fn solids_between(
        &self,
        points: &[Option<(DVec3, Surface)>; LANES],
        blocked: &mut [bool; LANES],
        shades: impl Fn(&Placed, DVec3) -> bool,
    ) {
        for placed in &self.solids {
            for (blocked, point) in blocked.iter_mut().zip(points) {
                let Some((point, surface)) = *point else {
                    continue;
                };
                // Seen from outside, a convex solid shades itself only by facing away.
                let own = self.object(surface) == placed.object && !placed.around_camera;
                *blocked = *blocked || !own && shades(placed, point);
            }
        }
    }

    /// Whether something stands between each point and a light far away; lanes with no point are
    /// not asked. What stands closer than [`OFF_POINT`] touches the point rather than shades it.
    pub(super) fn blocked_along(
        &self,
        towards: DVec3,
        points: &[Option<(DVec3, Surface)>; LANES],
        scratch: &mut Scratch,
    ) -> [bool; LANES] {
        let mut blocked = if self.bvh.is_empty() {
            [false; LANES]
        } else {
            let rays = points.map(|lane| {
                let (point, surface) = lane?;
                let start = point.length() as f32 * OFF_POINT;
                Some((point.as_vec3(), start, surface.0))
            });
            let rays = Parallel::new(towards.as_vec3(), &rays);
            self.bvh.blocked_along(rays, scratch)
        };
        self.solids_between(points, &mut blocked, |placed, point| {
            let origin = placed.solid_from_rig.point(point);
            let direction = placed.solid_from_rig.direction(towards);
            let start = point.length() * (1.0 - SHADOW_END);
            placed.solid.intersect(origin, direction, start).is_some()
        });
        blocked
    }
}
