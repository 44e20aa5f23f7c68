//! Phase to height against a reference plane, as Wu et al. have it, kept beside triangulation for
//! comparison with the paper:
//!
//! ```text
//! h = L dphi / (2 pi f0 D + dphi)
//! ```
//!
//! h is the height over the plane towards the camera, L the camera's distance from the plane, D the
//! baseline, f0 the fringes per mm on the plane, and dphi how far the phase of a camera pixel has
//! moved against that of the bare plane. Two similar triangles give it: a camera's ray that ends a
//! height h early sees the fringe that would fall h D / (L - h) aside on the plane.
//!
//! It is exact if both pupils are equally far from the plane and the projected coordinate is linear on
//! it: the projector's image plane stands parallel to the reference plane, and its lens does not
//! distort. The camera may look as it likes, and its lens may distort, for each pixel has its own
//! reference. `pmp-bench` is of that kind. Elsewhere heights are off by a part of themselves, of first
//! order in what is amiss: about e + e x / D, x mm beside the camera, where the projector is a part e
//! farther from the plane than the camera, and about 2 a x / L, x mm beside the projector, where it
//! is turned by an angle a about the fringes' direction. Triangulation knows no such limit.
//!
//! # Signs
//!
//! D is the component of the way from the camera's pupil to the projector's along the direction on
//! the plane in which the coordinate grows, with its sign, and dphi = -2 pi (x - x_plane) / period:
//! what is nearer than the plane moves the coordinate against that component. So h comes out
//! positive towards the camera with the projector on either side and whichever way its image runs.
//! The period cancels; it only makes f0 the number that one would count on the plane.

mod constants;
mod plane;
mod reference;

#[cfg(test)]
mod tests;

pub use constants::{Constants, Given};
pub use plane::Plane;
pub use reference::{Mapping, Quality, meeting_mm};
