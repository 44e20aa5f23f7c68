//! A scene prepared for ray casting at one instant: solids in closed form, all static meshes in one
//! hierarchy in the rig's frame, and each moving mesh in a hierarchy of its own.
//!
//! `build` creates it from a scene, `moving` bounds the motion between two states, and `extent`
//! computes the size of the scene.

mod build;
mod extent;
mod moving;

use super::animation::{Animation, Part, State};
use super::hits::{Hits, SHADOW_END, Surface};
use super::instance::Instance;
use super::tree::{Here, Points, Tree};
use crate::material::{Materials, Spot};
use glam::DVec3;
use phasmid_geometry::raycast::{Bvh, LANES, Scratch};
use phasmid_geometry::{Pose, Solid};
use std::sync::Arc;

/// Maximum number of facets of a solid.
const FACETS: u32 = 8;

#[derive(Clone)]
pub(crate) struct Placed {
    pub(crate) solid: Solid,
    rig_from_solid: Pose,
    pub(crate) solid_from_rig: Pose,
    pub(crate) object: u16,
    /// Whether the camera is inside the solid, so that it sees the inner wall, which the outer wall
    /// shades.
    pub(crate) around_camera: bool,
}

impl Placed {
    fn new(solid: Solid, rig_from_solid: Pose, object: u16) -> Self {
        let solid_from_rig = rig_from_solid.inverse();
        Self {
            solid,
            rig_from_solid,
            solid_from_rig,
            object,
            around_camera: solid.contains(solid_from_rig.translation_mm),
        }
    }
}

/// The time-independent part of a world.
#[derive(Default)]
struct Fixed {
    /// Vertices of the static meshes.
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    bvh: Bvh,
    /// Object of each triangle; the triangles of moving meshes come after the triangles of static
    /// meshes.
    owner: Vec<u16>,
    /// For each object, orientation of its triangles if it is a closed mesh; see [`World::outward`].
    outward: Vec<f64>,
    /// Moving objects, in order.
    paths: Vec<Animation>,
    /// Changes made to mesh files when they were read.
    notes: Vec<String>,
}

/// All surfaces at one instant.
#[derive(Clone)]
pub(crate) struct World {
    fixed: Arc<Fixed>,
    pub(crate) solids: Vec<Placed>,
    /// Moving meshes.
    pub(crate) instances: Vec<Instance>,
    /// Materials of the objects' surfaces.
    pub(crate) materials: Arc<Materials>,
}

impl World {
    pub(crate) fn triangle_count(&self) -> usize {
        self.fixed.owner.len()
    }

    /// Returns notes for the user about changes made to the scene's meshes.
    pub(crate) fn notes(&self) -> &[String] {
        &self.fixed.notes
    }

    /// Returns the object of each triangle.
    pub(crate) fn owners(&self) -> &[u16] {
        &self.fixed.owner
    }

    /// Returns 1 if the mesh that a triangle belongs to encloses a volume and its triangles are
    /// numbered counter-clockwise seen from outside, -1 if they are numbered clockwise, and 0 if it
    /// encloses no volume.
    pub(crate) fn outward(&self, triangle: Surface) -> f64 {
        self.fixed.outward[usize::from(self.fixed.owner[triangle.0 as usize])]
    }

    /// Returns whether anything moves.
    pub(crate) fn moves(&self) -> bool {
        !self.fixed.paths.is_empty()
    }

    /// Returns whether the object of a surface moves.
    pub(crate) fn moving(&self, surface: Surface) -> bool {
        self.object_moves(self.object(surface))
    }

    pub(crate) fn object_moves(&self, object: u16) -> bool {
        let paths = &self.fixed.paths;
        paths.binary_search_by_key(&object, |p| p.object).is_ok()
    }

    /// Returns the number of triangles in deforming meshes.
    pub(crate) fn deforming_triangles(&self) -> usize {
        self.instances
            .iter()
            .map(Instance::deforming_triangles)
            .sum()
    }

    /// Returns the state of all moving objects at a device time in nanoseconds.
    pub(crate) fn state(&self, time_ns: f64) -> State {
        State(
            self.fixed
                .paths
                .iter()
                .map(|path| path.at(time_ns))
                .collect(),
        )
    }

    /// Applies the poses and shapes of a state.
    pub(crate) fn set(&mut self, state: &State) {
        for (path, placement) in self.fixed.paths.iter().zip(&state.0) {
            if let (Part::Instance(i), Some(blend)) = (path.part, placement.blend) {
                self.instances[i].deform(blend);
            }
        }
        self.carry(state);
    }

    /// Applies the poses of a state, but not its shapes.
    pub(crate) fn carry(&mut self, state: &State) {
        for (path, placement) in self.fixed.paths.iter().zip(&state.0) {
            match path.part {
                Part::Instance(i) => self.instances[i].carry(placement.rig_from_object),
                Part::Solid(i) => {
                    let Placed { solid, object, .. } = self.solids[i];
                    self.solids[i] = Placed::new(solid, placement.rig_from_object, object);
                }
            }
        }
    }

    /// Returns whether surfaces may shade each other or themselves. A single convex solid seen from
    /// outside shades itself only where it faces away from the light, but a solid that moves may
    /// come to surround the camera.
    pub(crate) fn casts_shadows(&self) -> bool {
        let may_surround = |s: &Placed| {
            let hollow = !matches!(s.solid, Solid::Plane { .. });
            s.around_camera || hollow && self.object_moves(s.object)
        };
        self.triangle_count() > 0 || self.solids.len() > 1 || self.solids.iter().any(may_surround)
    }

    /// Returns whether a surface is a triangle of a mesh. Adjacent triangles of a mesh may form one
    /// smooth surface.
    pub(crate) fn is_triangle(&self, surface: Surface) -> bool {
        (surface.0 as usize) < self.triangle_count()
    }

    /// Returns the object that a surface belongs to.
    pub(crate) fn object(&self, surface: Surface) -> u16 {
        match self.fixed.owner.get(surface.0 as usize) {
            Some(&object) => object,
            None => self.solids[self.solid_of(surface)].object,
        }
    }

    /// Returns the corners of a triangle; `None` for facets of solids.
    pub(crate) fn corners(&self, surface: Surface) -> Option<[DVec3; 3]> {
        match self.fixed.triangles.get(surface.0 as usize) {
            Some(triangle) => Some(triangle.map(|i| self.fixed.vertices[i as usize])),
            None => Some(self.instance(surface)?.corners(surface)),
        }
    }

    /// Returns the moving mesh that a surface belongs to, if any.
    fn instance(&self, surface: Surface) -> Option<&Instance> {
        let after = self.instances.partition_point(|b| b.first() <= surface.0);
        let instance = self.instances.get(after.checked_sub(1)?)?;
        instance.holds(surface).then_some(instance)
    }

    /// Returns the moving mesh of an object; `None` if it is not a moving mesh.
    pub(crate) fn instance_of(&self, object: u16) -> Option<&Instance> {
        let is_its = |instance: &&Instance| self.object(Surface(instance.first())) == object;
        self.instances.iter().find(is_its)
    }

    /// Transforms the smooth normals at a triangle's corners from rest to the triangle's current
    /// state.
    pub(crate) fn smooth(&self, surface: Surface, rest: [DVec3; 3]) -> [DVec3; 3] {
        match self.instance(surface) {
            Some(instance) => instance.smooth(surface, rest),
            None => rest,
        }
    }

    /// Maps a spot on a surface to its rest position, where materials are defined.
    pub(crate) fn at_rest(&self, surface: Surface, spot: Spot) -> Spot {
        if let Some(instance) = self.instance(surface) {
            return instance.at_rest(surface, spot);
        }
        let object = self.object(surface);
        let paths = &self.fixed.paths;
        match paths.binary_search_by_key(&object, |p| p.object) {
            Ok(i) => {
                let now = &self.solids[self.solid_of(surface)];
                spot.moved(&(paths[i].rig_from_rest * now.solid_from_rig))
            }
            Err(_) => spot,
        }
    }

    fn solid_of(&self, surface: Surface) -> usize {
        (surface.0 as usize - self.triangle_count()) / FACETS as usize
    }

    /// Returns the hierarchy of all static meshes; `None` if there are none.
    pub(crate) fn still(&self) -> Option<Tree<'_, Here>> {
        let fixed = &self.fixed;
        (!fixed.bvh.is_empty()).then_some(Tree {
            bvh: &fixed.bvh,
            vertices: &fixed.vertices,
            triangles: &fixed.triangles,
            first: 0,
            frame: Here,
        })
    }

    /// Finds the nearest surface along each ray that starts at a point of the camera's pupil, whose
    /// centre is the rig's origin. Directions have z = 1.
    pub(crate) fn nearest(
        &self,
        origin: DVec3,
        directions: &[DVec3; LANES],
        used: &[bool; LANES],
        scratch: &mut Scratch,
    ) -> Hits {
        let ends = used.map(|u| if u { f32::INFINITY } else { -1.0 });
        let mut hits = match self.still() {
            Some(tree) => tree.nearest(origin, directions, &ends, scratch),
            None => Hits::none(),
        };
        for instance in &self.instances {
            let found = instance.tree().nearest(origin, directions, &ends, scratch);
            hits.take_nearer(&found);
        }
        for (i, placed) in self.solids.iter().enumerate() {
            let origin = placed.solid_from_rig.point(origin);
            let first = self.triangle_count() as u32 + i as u32 * FACETS;
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

    /// Returns whether each point is occluded from the projector's pupil; lanes without a point are
    /// skipped.
    pub(crate) fn blocked(
        &self,
        pupil: DVec3,
        points: &Points,
        scratch: &mut Scratch,
    ) -> [bool; LANES] {
        let mut blocked = [false; LANES];
        if let Some(tree) = self.still() {
            tree.blocked(pupil, points, &mut blocked, scratch);
        }
        for instance in &self.instances {
            instance
                .tree()
                .blocked(pupil, points, &mut blocked, scratch);
        }
        self.solids_between(points, &mut blocked, |placed, point| {
            let origin = placed.solid_from_rig.point(pupil);
            let direction = placed.solid_from_rig.direction(point - pupil);
            let hit = placed.solid.intersect(origin, direction, 0.0);
            hit.is_some_and(|hit| hit.t < SHADOW_END)
        });
        blocked
    }

    /// Marks the points that solids shade; `shades` tests whether one solid shades one point.
    fn solids_between(
        &self,
        points: &Points,
        blocked: &mut [bool; LANES],
        shades: impl Fn(&Placed, DVec3) -> bool,
    ) {
        for placed in &self.solids {
            for (blocked, point) in blocked.iter_mut().zip(points) {
                let Some((point, surface)) = *point else {
                    continue;
                };
                // Seen from outside, a convex solid shades itself only where it faces away from the
                // light.
                let own = surface != Surface::NONE
                    && self.object(surface) == placed.object
                    && !placed.around_camera;
                *blocked = *blocked || !own && shades(placed, point);
            }
        }
    }

    /// Returns whether each point is occluded from a light at infinity; lanes without a point are
    /// skipped. Occluders closer than [`OFF_POINT`](super::hits::OFF_POINT) count as touching the
    /// point and do not shade it.
    pub(crate) fn blocked_along(
        &self,
        towards: DVec3,
        points: &Points,
        scratch: &mut Scratch,
    ) -> [bool; LANES] {
        let mut blocked = [false; LANES];
        if let Some(tree) = self.still() {
            tree.blocked_along(towards, points, &mut blocked, scratch);
        }
        for instance in &self.instances {
            let tree = instance.tree();
            tree.blocked_along(towards, points, &mut blocked, scratch);
        }
        self.solids_between(points, &mut blocked, |placed, point| {
            let origin = placed.solid_from_rig.point(point);
            let direction = placed.solid_from_rig.direction(towards);
            let start = point.length() * (1.0 - SHADOW_END);
            placed.solid.intersect(origin, direction, start).is_some()
        });
        blocked
    }
}

/// Maximum distance at which a surface counts as touching a point, relative to the point's distance
/// from the rig: 1 um at 1 m, far above the error of a depth in f32.
const OFF_POINT: f64 = 1e-6;

impl World {
    /// Finds the nearest surface along each ray that starts at a point of a surface `own`, given in
    /// the rig's frame. Directions have unit length and point to the side of the surface that the
    /// camera sees.
    pub(crate) fn leaving(
        &self,
        point: DVec3,
        own: Surface,
        directions: &[DVec3; LANES],
        scratch: &mut Scratch,
    ) -> Hits {
        let mut hits = match self.still() {
            Some(tree) => tree.leaving(point, directions, scratch),
            None => Hits::none(),
        };
        for instance in &self.instances {
            hits.take_nearer(&instance.tree().leaving(point, directions, scratch));
        }
        let start = point.length() * OFF_POINT;
        for (i, placed) in self.solids.iter().enumerate() {
            // A ray that leaves a convex solid seen from outside cannot hit the same solid again.
            if self.object(own) == placed.object && !placed.around_camera {
                continue;
            }
            let origin = placed.solid_from_rig.point(point);
            let first = self.triangle_count() as u32 + i as u32 * FACETS;
            for (lane, &direction) in directions.iter().enumerate() {
                let local = placed.solid_from_rig.direction(direction);
                if let Some(found) = placed.solid.intersect(origin, local, start)
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
}
