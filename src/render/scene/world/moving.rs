//! Motion of objects in the camera's image.

use super::World;
use super::extent::radius;
use crate::scene::animation::{Blend, Part, Placement, State};
use phasmid_geometry::Pose;

impl World {
    /// Returns an upper bound, in radians seen from the camera, of any motion between two states;
    /// infinite if an object's distance from the camera is within its radius.
    ///
    /// A point at a distance r from its object's origin moves at most by the translation of the
    /// origin, plus r times the rotation angle, plus, for each keyframe, the change of its weight
    /// times the maximum displacement of a vertex from rest in that keyframe: weights add up to 1.
    pub(crate) fn way_rad(&self, from: &State, to: &State) -> f64 {
        let ends = from.0.iter().zip(&to.0);
        let ways = self.fixed.paths.iter().zip(ends).map(|(path, (from, to))| {
            let (radius, shape) = match path.part {
                Part::Solid(i) => (radius(&self.solids[i].solid), 0.0),
                Part::Instance(i) => {
                    let model = self.instances[i].model();
                    (model.radius_mm, reshaped_mm(from, to, &model.key_reach_mm))
                }
            };
            // An infinite plane has no radius and may be hit anywhere.
            let distance = from.rig_from_object.translation_mm.length() - radius;
            let way = carried_mm(&from.rig_from_object, &to.rig_from_object, radius) + shape;
            match (way == 0.0, distance > radius && radius > 0.0) {
                (true, _) => 0.0,
                (false, true) => way / distance,
                (false, false) => f64::INFINITY,
            }
        });
        ways.fold(0.0, f64::max)
    }
}

/// Returns the maximum motion of a point within a radius of the origin of an object that moves from
/// one pose to another.
fn carried_mm(from: &Pose, to: &Pose, radius_mm: f64) -> f64 {
    let turn = |axis: usize| (to.rotation.col(axis) - from.rotation.col(axis)).length_squared();
    // The Frobenius norm of the difference is an upper bound of how much it stretches a vector.
    let stretch = (0..3).map(turn).sum::<f64>().sqrt();
    (to.translation_mm - from.translation_mm).length() + radius_mm * stretch
}

/// Returns the maximum motion of a mesh vertex due to changed keyframe weights.
fn reshaped_mm(from: &Placement, to: &Placement, key_reach_mm: &[f64]) -> f64 {
    let weight = |blend: &Option<Blend>, key: usize| {
        let Some((keys, weights)) = blend else {
            return 0.0;
        };
        let its = keys.iter().zip(weights).filter(|(k, _)| **k == key);
        its.map(|(_, w)| *w).sum::<f64>()
    };
    let ways = key_reach_mm.iter().enumerate().map(|(key, reach)| {
        let change = weight(&to.blend, key) - weight(&from.blend, key);
        reach * change.abs()
    });
    ways.sum()
}
