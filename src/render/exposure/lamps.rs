//! Lamps. Their light does not depend on the pattern, so the geometry pass adds it to the ambient
//! light.

use crate::scene::{Surface, World};
use glam::DVec3;
use phasmid_geometry::Pose;
use phasmid_geometry::raycast::{LANES, Scratch};
use phasmid_profile::{self as profile, Scene};

/// A lamp of the scene, in the rig's frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lamp {
    pub(crate) shape: LampShape,
    /// Amplitude of the lamp's flicker relative to its mean light.
    pub(crate) depth: f64,
}

#[derive(Debug, Clone, Copy)]
pub(crate) enum LampShape {
    Point {
        at: DVec3,
        intensity_w_sr: f64,
    },
    Directional {
        towards: DVec3,
        irradiance_w_m2: f64,
    },
}

impl Lamp {
    pub(crate) fn all(scene: &Scene) -> Vec<Self> {
        let rig_from_scene = scene.rig_from_scene();
        let lamp = |light| Self::new(light, rig_from_scene);
        let lit = scene.light.iter().filter(|light| light.is_on());
        lit.map(lamp).collect()
    }

    fn new(light: &profile::Light, rig_from_scene: Pose) -> Self {
        Self {
            shape: match *light {
                profile::Light::Point {
                    position_mm,
                    intensity_w_sr,
                    ..
                } => LampShape::Point {
                    at: rig_from_scene.point(DVec3::from_array(position_mm)),
                    intensity_w_sr,
                },
                profile::Light::Directional {
                    direction,
                    irradiance_w_m2,
                    ..
                } => LampShape::Directional {
                    towards: -rig_from_scene.direction(DVec3::from_array(direction).normalize()),
                    irradiance_w_m2,
                },
            },
            depth: light.flicker().map_or(0.0, |flicker| flicker.depth),
        }
    }

    /// Returns the direction from a point to the lamp, and the irradiance in W/m^2 on a surface at
    /// the point that faces the lamp.
    pub(crate) fn seen_from(&self, point: DVec3) -> (DVec3, f64) {
        match self.shape {
            LampShape::Point { at, intensity_w_sr } => {
                let way = at - point;
                // Inverse-square law, converted from millimetres to metres. At the lamp itself the
                // direction is undefined, and the irradiance is set to zero instead of infinity.
                let distance2 = way.length_squared();
                let towards = way.try_normalize().unwrap_or(DVec3::ZERO);
                (towards, intensity_w_sr * 1e6 / distance2)
            }
            LampShape::Directional {
                towards,
                irradiance_w_m2,
            } => (towards, irradiance_w_m2),
        }
    }

    /// Returns for each point whether the lamp is occluded.
    pub(crate) fn blocked(
        &self,
        world: &World,
        points: &[Option<(DVec3, Surface)>; LANES],
        scratch: &mut Scratch,
    ) -> [bool; LANES] {
        match self.shape {
            LampShape::Point { at, .. } => world.blocked(at, points, scratch),
            LampShape::Directional { towards, .. } => world.blocked_along(towards, points, scratch),
        }
    }
}
