//! A calibration board's ink.

use super::spot::Spot;
use glam::DVec3;
use phasmid_geometry::{Board, Pose};
use phasmid_profile::{Object, Scene};

/// A board printed on the side facing -z in the object's own frame.
pub(crate) struct Printed {
    /// Scaled as the object is.
    pub(crate) board: Board,
    /// Factor on the albedo where there is ink.
    pub(crate) ink: f64,
    pub(crate) object_from_rig: Pose,
}

impl Printed {
    pub(super) fn new(board: Board, ink: f64, scene: &Scene, object: &Object) -> Self {
        Self {
            board: board.scaled(object.scale),
            ink,
            object_from_rig: scene.rig_from_object(object).inverse(),
        }
    }

    /// Returns the mean over a spot's footprint in the rest frame.
    pub(super) fn albedo(&self, spot: &Spot) -> f64 {
        let own = |v: DVec3| self.object_from_rig.direction(v);
        if !(own(spot.normal).z < 0.0) {
            return 1.0;
        }
        let at = self.object_from_rig.point(spot.point).truncate();
        let [across, down] = spot.sides.map(|side| own(side).truncate());
        1.0 - (1.0 - self.ink) * self.board.ink(at, across, down)
    }
}
