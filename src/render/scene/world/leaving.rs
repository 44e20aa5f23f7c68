//! Rays that leave a surface for other surfaces.

use super::{FACETS, World};
use crate::scene::hits::{Hits, Surface};
use glam::DVec3;
use phasmid_geometry::raycast::{LANES, Scratch};

/// Surfaces closer to a point than this fraction of its distance from the rig touch it: 1 um at 1
/// m, far above the error of a depth in f32.
const OFF_POINT: f64 = 1e-6;

impl World {
    /// Finds the nearest surface along each ray from a point of a surface `own`, given in the rig's
    /// frame. Directions have unit length and are on the side of the surface that the camera sees.
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
            // A ray that leaves a convex solid, seen from outside, cannot hit the same solid.
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
