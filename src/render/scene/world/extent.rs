//! Extent of a scene.

use super::{Placed, World};
use glam::{DVec2, DVec3};
use phasmid_geometry::Solid;
use phasmid_geometry::raycast::Bvh;

/// Factor by which a spline may overshoot its keyframes.
const SWING: f64 = 1.25;

/// Returns the radius of a solid about the origin of its own frame; 0 for infinite planes.
pub(super) fn radius(solid: &Solid) -> f64 {
    match *solid {
        Solid::Plane { half } if half.is_finite() => half.length(),
        Solid::Plane { .. } => 0.0,
        Solid::Sphere { radius } => radius,
        Solid::Cylinder {
            radius,
            half_length,
        } => radius.hypot(half_length),
        Solid::Frustum { faces } => {
            // The top face's offset is the frustum's height. A side face's offset is half of the
            // base, reduced by the tilt of the side.
            let (side, offset) = faces[2];
            let half_base = offset / side.x;
            half_base.mul_add(std::f64::consts::SQRT_2, faces[0].1)
        }
    }
}

impl Placed {
    /// Returns whether the solid is an infinite plane, which divides space into two halves.
    pub(crate) fn halves_space(&self) -> bool {
        matches!(self.solid, Solid::Plane { half } if half.cmpeq(DVec2::INFINITY).all())
    }

    /// Returns the centre and the radius of a ball that contains the solid, in the rig's frame.
    pub(crate) fn ball(&self) -> (DVec3, f64) {
        let radius = match self.solid {
            Solid::Plane { half } if !half.is_finite() => f64::INFINITY,
            ref solid => radius(solid),
        };
        (self.rig_from_solid.translation_mm, radius)
    }
}

impl World {
    /// Returns the maximum distance from the rig's origin, in millimetres, that any surface has now
    /// or may have after motion; infinite planes are ignored.
    pub(crate) fn farthest_mm(&self) -> f64 {
        let root = self.fixed.bvh.nodes().first();
        let still = root.map_or(0.0, |root| {
            root.min.abs().max(root.max.abs()).as_dvec3().length()
        });
        let solids = self.solids.iter().map(|s| {
            let way = self.way_mm(s.object);
            s.solid_from_rig.translation_mm.length() + way + radius(&s.solid)
        });
        let instances = self.instances.iter().map(|instance| {
            let model = instance.model();
            let shapes = std::iter::once(&model.vertices).chain(&model.keys);
            let radius = shapes.flatten().map(|v| v.length()).fold(0.0, f64::max);
            let object = self.fixed.owner[model.first as usize];
            model.rig_from_rest.translation_mm.length() + self.way_mm(object) + radius
        });
        solids.chain(instances).fold(still, f64::max)
    }

    /// Returns the maximum distance in millimetres by which an object may move from its rest
    /// position.
    fn way_mm(&self, object: u16) -> f64 {
        let paths = &self.fixed.paths;
        match paths.binary_search_by_key(&object, |p| p.object) {
            Ok(i) => paths[i].reach_mm() * SWING,
            Err(_) => 0.0,
        }
    }

    /// Returns all hierarchies.
    pub(crate) fn hierarchies(&self) -> impl Iterator<Item = &Bvh> {
        let instances = self.instances.iter().map(|instance| instance.tree().bvh);
        std::iter::once(&self.fixed.bvh).chain(instances)
    }
}
