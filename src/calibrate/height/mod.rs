//! Phase-to-height conversion against a reference plane after Wu et al., kept beside triangulation
//! for comparison with their paper:
//!
//! ```text
//! h = L dphi / (2 pi f0 D + dphi)
//! ```
//!
//! h is the height above the plane towards the camera, L the camera's distance from the plane, D
//! the baseline, f0 the number of fringes per mm on the plane, and dphi the phase shift of a camera
//! pixel relative to the bare plane. The formula follows from two similar triangles: a camera ray
//! that meets the surface at height h sees the fringe that would fall on the plane at a distance of
//! h D / (L - h) from where the ray itself would meet it.
//!
//! The formula is exact if both pupils are equally far from the plane and the projected coordinate
//! is linear on it, that is, if the projector's image plane is parallel to the reference plane and
//! its lens has no distortion. The camera may have any orientation and distortion, because each
//! pixel has its own reference. `pmp-bench` is such a rig. For other rigs heights have a relative
//! error. To first order it is e + e x / D at x mm beside the camera if the projector is farther
//! from the plane than the camera by a fraction e, and 2 a x / L at x mm beside the projector if
//! the projector is rotated by an angle a about the direction of the fringes. Triangulation has no
//! such limit.
//!
//! # Signs
//!
//! D is the component of the vector from the camera's pupil to the projector's along the direction
//! on the plane in which the coordinate grows, with its sign, and dphi = -2 pi (x - x_plane) /
//! period: a surface nearer than the plane shifts the coordinate against that component. So h is
//! positive towards the camera whichever side the projector is on and however its image is
//! oriented. The period cancels; it only makes f0 the number of fringes that can be counted on the
//! plane.
//!
//! # Files
//!
//! - `constants`: the constants L, D, f0 and the formula
//! - `plane`: the reference plane and its fit
//! - `reference`: the reference of each camera pixel, and the conversion of coordinates to depths

mod constants;
mod plane;
mod reference;

#[cfg(test)]
mod tests;

pub use constants::{Constants, Given};
pub use plane::Plane;
pub use reference::{Mapping, Quality};
