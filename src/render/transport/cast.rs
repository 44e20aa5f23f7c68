//! Casts sixteen camera rays: finds the surfaces that they hit, and the light at the hits.

use super::rays::Bundle;
use super::reflect;
use crate::exposure::Optics;
use crate::scene::{Hits, Occluders, Shaded, Surface, World};
use crate::{Plan, Term};
use glam::DVec3;
use phasmid_geometry::raycast::{LANES, Scratch};

/// Sixteen cast rays with their hits and shading.
pub(super) struct Cast {
    /// Origin of the rays, a point of the camera's pupil.
    pub(super) origin: DVec3,
    pub(super) hits: Hits,
    pub(super) shaded: Shaded,
    /// Whether the projector lights the hit of each ray.
    pub(super) lit: [bool; LANES],
}

/// Casts sixteen camera rays, and the shadow rays that they need. If `occluders` is given, the rays
/// must start at the rig's origin.
pub(super) fn cast(
    world: &World,
    optics: &Optics,
    plan: &Plan,
    bundle: &Bundle,
    occluders: Option<&Occluders>,
    scratch: &mut Scratch,
) -> Cast {
    let (origin, directions) = (bundle.origin, &bundle.directions);
    let hits = world.nearest(origin, directions, &bundle.used, scratch);
    let mut shaded = optics.shade(plan, origin, directions, &hits, world);
    // Skip shadow rays to points that the projector cannot light.
    let mut lit: [bool; LANES] =
        std::array::from_fn(|lane| hits.is_hit(lane) && shaded.reachable[lane]);
    if plan.has(Term::Shadows) && lit.contains(&true) {
        let points: [Option<(DVec3, Surface)>; LANES] = std::array::from_fn(|lane| {
            let point = origin + DVec3::from_array(shaded.point.map(|axis| axis[lane]));
            let doubtful = lit[lane] && !occluders.is_some_and(|o| o.leave_lit(point));
            doubtful.then_some((point, hits.surface[lane]))
        });
        if points.iter().any(Option::is_some) {
            let blocked = world.blocked(optics.projector.center(), &points, scratch);
            for lane in 0..LANES {
                lit[lane] &= !blocked[lane];
            }
        }
    }
    if reflect::is_needed(plan) {
        let rays = reflect::Rays {
            world,
            optics,
            plan,
            bundle,
            hits: &hits,
        };
        reflect::apply(&rays, &mut shaded, scratch);
    }
    if plan.has(Term::CameraVignetting) {
        optics.dim_seen(directions, &mut shaded);
    }
    Cast {
        origin,
        hits,
        shaded,
        lit,
    }
}

impl Cast {
    /// Returns the hit point of a lane's ray, relative to its origin.
    pub(super) fn point(&self, lane: usize) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|axis| self.shaded.point[axis][lane]))
    }
}
