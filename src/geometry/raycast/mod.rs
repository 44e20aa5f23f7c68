//! Ray casting: packets of rays with one origin against triangles in a bounding volume hierarchy.
//!
//! Parallel rays, for light from far away, are handled by [`Parallel`]. Rays that leave a surface
//! point in all directions are packets for [`Bvh::leaving`].
//!
//! A packet holds [`LANES`] rays that start at one point: the camera's pupil for primary rays, the
//! projector's for shadow rays. Neighbouring pixels visit the same nodes, so a node is loaded once
//! for all lanes, and every lane does the same arithmetic in SIMD registers. Where the rays hardly
//! diverge, nodes have eight children, whose boxes are tested against the packet as a whole. The
//! triangle test is watertight (Woop, Benthin, Wald: "Watertight Ray/Triangle Intersection", JCGT
//! 2013), in f32 with the edge case decided in f64; the caller solves an accepted hit again in f64.
//! Each hit has an error bound, and hits that f32 cannot order are all returned for the caller to
//! order in f64.

mod bvh;
mod cast;
mod leaving;
mod node;
mod packet;
mod parallel;
mod refit;
#[cfg(test)]
mod tests;
mod traverse;
mod triangle;
mod wide;

pub use bvh::{Bvh, Corners, NO_TRIANGLE};
pub use node::Node;
pub use packet::{LANES, Packet, Scratch};
pub use parallel::Parallel;
