//! Motion of objects in the camera's image.

use super::World;
use super::extent::radius;
use crate::scene::animation::{Blend, Part, Placement, State};
use glam::{DMat3, DVec3};

impl World {
    /// Returns an upper bound, in radians as seen from the camera, of the motion of any point
    /// between two states; infinite if an object's distance from the camera is within its radius.
    pub(crate) fn way_rad(&self, from: &State, to: &State) -> f64 {
        self.displacement_rad(&[(1.0, to), (-1.0, from)])
    }

    /// Returns an upper bound, in radians as seen from the camera, of the displacement of any point
    /// by a weighted sum of states. The weights add up to 0, for example for the difference between
    /// two states, or between a state and an interpolated one. Infinite if an object's distance from
    /// the camera is within its radius.
    ///
    /// A point at a distance r from its object's origin moves at most by the translation of the
    /// origin, plus r times the rotation angle, plus, for each keyframe, the change of the
    /// keyframe's weight times the maximum displacement of a vertex from rest in that keyframe. This
    /// holds because the weights of the keyframes add up to 1.
    pub(crate) fn displacement_rad(&self, sum: &[(f64, &State)]) -> f64 {
        let ways = self.fixed.paths.iter().enumerate().map(|(i, path)| {
            let terms: Vec<_> = sum.iter().map(|(w, state)| (*w, &state.0[i])).collect();
            let (radius, shape) = match path.part {
                Part::Solid(i) => (radius(&self.solids[i].solid), 0.0),
                Part::Instance(i) => {
                    let model = self.instances[i].model();
                    (model.radius_mm, reshaped_mm(&terms, &model.key_reach_mm))
                }
            };
            // An infinite plane has no radius and may be hit anywhere.
            let origin = |(_, at): &(f64, &Placement)| at.rig_from_object.translation_mm.length();
            let distance = terms.last().map_or(0.0, origin) - radius;
            let way = carried_mm(&terms, radius) + shape;
            match (way == 0.0, distance > radius && radius > 0.0) {
                (true, _) => 0.0,
                (false, true) => way / distance,
                (false, false) => f64::INFINITY,
            }
        });
        ways.fold(0.0, f64::max)
    }
}

/// Returns the maximum displacement, by a weighted sum of poses, of any point within a radius of the
/// object's origin, in millimetres.
fn carried_mm(terms: &[(f64, &Placement)], radius_mm: f64) -> f64 {
    let (mut turn, mut shift) = (DMat3::ZERO, DVec3::ZERO);
    for (weight, at) in terms {
        turn += at.rig_from_object.rotation * *weight;
        shift += at.rig_from_object.translation_mm * *weight;
    }
    // The Frobenius norm of a matrix is an upper bound of the factor by which it stretches a vector.
    let squares = (0..3).map(|axis| turn.col(axis).length_squared());
    let stretch = squares.sum::<f64>().sqrt();
    shift.length() + radius_mm * stretch
}

/// Returns the maximum displacement of a mesh vertex by a weighted sum of keyframe weights.
fn reshaped_mm(terms: &[(f64, &Placement)], key_reach_mm: &[f64]) -> f64 {
    let weight = |blend: &Option<Blend>, key: usize| {
        let Some((keys, weights)) = blend else {
            return 0.0;
        };
        let its = keys.iter().zip(weights).filter(|(k, _)| **k == key);
        its.map(|(_, w)| *w).sum::<f64>()
    };
    let ways = key_reach_mm.iter().enumerate().map(|(key, reach)| {
        let change: f64 = terms.iter().map(|(w, at)| w * weight(&at.blend, key)).sum();
        reach * change.abs()
    });
    ways.sum()
}
