//! Hits of sixteen rays: the surfaces that the rays meet, and the light at the hits.

use glam::DVec3;
use phasmid_geometry::raycast::LANES;

/// Fraction of a shadow ray's length beyond which an occluder counts as touching the point at the
/// ray's end and does not shade it. The remainder is 1 nm at 1 m, far above the error of f64.
pub(super) const SHADOW_END: f64 = 1.0 - 1e-9;
/// Offset of the start of shadow rays to a light at infinity, relative to the point's distance from
/// the rig: 10 um at 1 m. It keeps the f32 error of a neighbouring triangle (about 1e-7 of that
/// distance) from shading the point.
pub(super) const OFF_POINT: f32 = 1e-5;

/// One f64 for each of sixteen rays.
pub(crate) type Wide = [f64; LANES];

/// Index of a smooth piece of surface, which is a triangle or a facet of a solid. The index is
/// unique within the world.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Surface(pub(crate) u32);

impl Surface {
    /// No surface.
    pub(crate) const NONE: Self = Self(u32::MAX);
}

/// Hits of sixteen camera rays.
pub(crate) struct Hits {
    /// Ray parameter of each hit, which is the depth if directions have z = 1; infinite without a
    /// hit.
    pub(crate) t: Wide,
    /// Unit normals on the side from which the rays come, one array per component.
    pub(crate) normal: [Wide; 3],
    pub(crate) surface: [Surface; LANES],
}

impl Hits {
    pub(super) fn none() -> Self {
        Self {
            t: [f64::INFINITY; LANES],
            normal: [[0.0; LANES]; 3],
            surface: [Surface::NONE; LANES],
        }
    }

    pub(crate) fn is_hit(&self, lane: usize) -> bool {
        self.surface[lane] != Surface::NONE
    }

    pub(crate) fn normal(&self, lane: usize) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|axis| self.normal[axis][lane]))
    }

    /// Records a hit, with the normal flipped to the side from which the ray comes.
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

    /// Replaces each hit by the hit of `other` if the latter is nearer.
    pub(super) fn take_nearer(&mut self, other: &Self) {
        for lane in 0..LANES {
            if other.t[lane] < self.t[lane] {
                self.t[lane] = other.t[lane];
                self.surface[lane] = other.surface[lane];
                for axis in 0..3 {
                    self.normal[axis][lane] = other.normal[axis][lane];
                }
            }
        }
    }
}

/// Samples of the surfaces that sixteen rays hit; lanes without a hit hold NaN and false.
pub(crate) struct Shaded {
    /// Points relative to the rays' origin, along the rig's axes, in millimetres; one array per
    /// component.
    pub(crate) point: [Wide; 3],
    /// Projector pixel that lights the point.
    pub(crate) px: [Wide; 2],
    /// Derivatives of the projector pixel with respect to the camera pixel: `[projector
    /// axis][camera axis]`.
    pub(crate) footprint: [[Wide; 2]; 2],
    /// Electrons per second from the projector at full white, ignoring shadows.
    pub(crate) projected: Wide,
    /// Electrons per second from ambient light.
    pub(crate) ambient: Wide,
    /// Flicker amplitude of ambient light and lamps, in electrons per second.
    pub(crate) flickering: Wide,
    /// Electrons per second under uniform light of 1 W/m^2 from all directions; 0 if the plan does
    /// not include interreflection.
    pub(crate) evenly: Wide,
    /// Bit mask of the lamps that light the sample.
    pub(crate) lamps: [u32; LANES],
    /// Whether the projector can light the sample, ignoring shadows: the sample is in the
    /// projector's field and its surface faces the projector.
    pub(crate) reachable: [bool; LANES],
    /// Whether the rays to the camera and to the projector are both within 80 degrees of the
    /// normal.
    pub(crate) square: [bool; LANES],
}
