//! Ray casting against the triangles of one hierarchy: f32 finds candidates, f64 orders them. A
//! hierarchy may have its own frame, which moves relative to the rig; whole ray packets are then
//! transformed into this frame.

use super::hits::{Hits, OFF_POINT, Surface};
use super::triangle::Triangle;
use glam::{DVec3, Vec3};
use phasmid_geometry::Pose;
use phasmid_geometry::raycast::{Bvh, LANES, NO_TRIANGLE, Packet, Parallel, Scratch};

/// Surface points to test, one for each of sixteen rays.
pub(crate) type Points = [Option<(DVec3, Surface)>; LANES];

/// Frame of a hierarchy relative to the rig.
pub(crate) trait Frame {
    /// Transforms a point from the rig's frame to the hierarchy's frame.
    fn point(&self, p: DVec3) -> DVec3;
    fn direction(&self, d: DVec3) -> DVec3;
    /// Transforms a vertex from the hierarchy's frame to the rig's frame.
    fn vertex(&self, v: DVec3) -> DVec3;
}

/// Frame of a hierarchy that is stored in the rig's frame.
pub(crate) struct Here;

impl Frame for Here {
    #[inline(always)]
    fn point(&self, p: DVec3) -> DVec3 {
        p
    }
    #[inline(always)]
    fn direction(&self, d: DVec3) -> DVec3 {
        d
    }
    #[inline(always)]
    fn vertex(&self, v: DVec3) -> DVec3 {
        v
    }
}

/// Frame of a hierarchy that has a pose of its own.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Elsewhere {
    pub(crate) rig_from_tree: Pose,
    pub(crate) tree_from_rig: Pose,
}

impl Frame for Elsewhere {
    fn point(&self, p: DVec3) -> DVec3 {
        self.tree_from_rig.point(p)
    }
    fn direction(&self, d: DVec3) -> DVec3 {
        self.tree_from_rig.direction(d)
    }
    fn vertex(&self, v: DVec3) -> DVec3 {
        self.rig_from_tree.point(v)
    }
}

/// A hierarchy and the mesh from which it was built.
pub(crate) struct Tree<'a, F> {
    pub(crate) bvh: &'a Bvh,
    pub(crate) vertices: &'a [DVec3],
    pub(crate) triangles: &'a [[u32; 3]],
    /// Index of the tree's first triangle among the world's surfaces.
    pub(crate) first: u32,
    pub(crate) frame: F,
}

impl<F: Frame> Tree<'_, F> {
    /// Returns the corners of a triangle, numbered from 0 within this tree, in the rig's frame.
    pub(crate) fn corners(&self, id: u32) -> [DVec3; 3] {
        self.triangles[id as usize].map(|i| self.frame.vertex(self.vertices[i as usize]))
    }

    fn triangle(&self, id: u32, origin: DVec3) -> Triangle {
        let corners = self.corners(id).map(|corner| corner - origin);
        Triangle::new(self.first + id, corners)
    }

    /// Returns the index of a surface within this tree; [`NO_TRIANGLE`] for surfaces outside it.
    fn own(&self, surface: Surface) -> u32 {
        let id = surface.0.wrapping_sub(self.first);
        if (id as usize) < self.triangles.len() {
            id
        } else {
            NO_TRIANGLE
        }
    }

    /// Finds the nearest triangle along each ray; triangles beyond `ends` may be skipped.
    pub(crate) fn nearest(
        &self,
        origin: DVec3,
        directions: &[DVec3; LANES],
        ends: &[f32; LANES],
        scratch: &mut Scratch,
    ) -> Hits {
        let mut hits = Hits::none();
        let rounded = directions.map(|d| self.frame.direction(d).as_vec3());
        let mut packet = Packet::new(self.frame.point(origin).as_vec3(), &rounded, ends);
        self.bvh.nearest(&mut packet, scratch);
        // Adjacent lanes often hit the same triangle.
        let mut last: Option<(u32, Triangle)> = None;
        for lane in 0..LANES {
            let id = packet.triangle[lane];
            if id == NO_TRIANGLE {
                continue;
            }
            if last.as_ref().is_none_or(|(known, _)| *known != id) {
                last = Some((id, self.triangle(id, origin)));
            }
            if let Some((_, triangle)) = &last {
                triangle.take(directions[lane], lane, &mut hits);
            }
        }
        for &(lane, id) in &scratch.rivals {
            let found = self.triangle(hits.surface[lane].0 - self.first, origin);
            let rival = self.triangle(id, origin);
            rival.take_from(&found, directions[lane], lane, &mut hits);
        }
        hits
    }

    /// Finds the nearest triangle along each ray that starts on a surface, ignoring the plane of
    /// that surface. Directions have unit length.
    pub(crate) fn leaving(
        &self,
        point: DVec3,
        directions: &[DVec3; LANES],
        scratch: &mut Scratch,
    ) -> Hits {
        let mut hits = Hits::none();
        let rounded = directions.map(|d| self.frame.direction(d).as_vec3());
        let from = self.frame.point(point).as_vec3();
        let mut packet = Packet::new(from, &rounded, &[f32::INFINITY; LANES]);
        self.bvh.leaving(&mut packet, scratch);
        for lane in 0..LANES {
            if packet.triangle[lane] != NO_TRIANGLE {
                let near = f64::from(packet.t[lane]);
                let triangle = self.triangle(packet.triangle[lane], point);
                triangle.take_near(near, directions[lane], lane, &mut hits);
            }
        }
        hits
    }

    /// Marks the points that this tree's triangles occlude from a projector's pupil; points that are
    /// already marked are skipped.
    pub(crate) fn blocked(
        &self,
        pupil: DVec3,
        points: &Points,
        blocked: &mut [bool; LANES],
        scratch: &mut Scratch,
    ) {
        let asked: Points = std::array::from_fn(|lane| points[lane].filter(|_| !blocked[lane]));
        let towards = asked.map(|p| {
            p.map_or(Vec3::ZERO, |(p, _)| {
                self.frame.direction(p - pupil).as_vec3()
            })
        });
        let ends = asked.map(|p| if p.is_some() { 1.0 } else { -1.0 });
        let mut packet = Packet::new(self.frame.point(pupil).as_vec3(), &towards, &ends);
        packet.triangle = asked.map(|p| p.map_or(NO_TRIANGLE, |(_, surface)| self.own(surface)));
        self.bvh.blocked(&mut packet, scratch);
        for lane in 0..LANES {
            blocked[lane] |= asked[lane].is_some() && packet.t[lane] < 0.0;
        }
        for &(lane, id) in &scratch.rivals {
            if let (Some((point, _)), false) = (asked[lane], blocked[lane]) {
                blocked[lane] = self.triangle(id, pupil).stands_before(point - pupil);
            }
        }
    }

    /// Same as `blocked`, for a light at infinity in the direction of a unit vector.
    pub(crate) fn blocked_along(
        &self,
        towards: DVec3,
        points: &Points,
        blocked: &mut [bool; LANES],
        scratch: &mut Scratch,
    ) {
        let rays = std::array::from_fn(|lane| {
            let (point, surface) = points[lane].filter(|_| !blocked[lane])?;
            let start = point.length() as f32 * OFF_POINT;
            let from = self.frame.point(point).as_vec3();
            Some((from, start, self.own(surface)))
        });
        let rays = Parallel::new(self.frame.direction(towards).as_vec3(), &rays);
        let found = self.bvh.blocked_along(rays, scratch);
        for (blocked, found) in blocked.iter_mut().zip(found) {
            *blocked |= found;
        }
    }
}
