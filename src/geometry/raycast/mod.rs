//! Ray casting: packets of rays with one origin against triangles in a bounding volume hierarchy.
//!
//! Light from far away has rays of one direction instead: [`Parallel`]. Rays that leave a point of
//! a surface to all sides are packets too, for [`Bvh::leaving`].
//!
//! A packet holds [`LANES`] rays that start at one point: the camera's pupil for primary rays, the
//! projector's for shadow rays. Neighbouring pixels visit the same nodes, so a node is loaded once
//! for all of them, and every lane does the same arithmetic in SIMD registers. The triangle test is
//! watertight (Woop, Benthin, Wald: "Watertight Ray/Triangle Intersection", JCGT 2013), in f32 with
//! the edge case decided in f64; the caller solves an accepted hit again in f64. Each hit has a bound
//! on its error, and hits that f32 cannot put in order are all handed out, for f64 to do so.

mod bvh;
mod leaving;
mod packet;
mod parallel;
mod refit;
#[cfg(test)]
mod tests;
mod traverse;
mod triangle;

pub use bvh::{Bvh, Corners, NO_TRIANGLE, Node};
pub use packet::{LANES, Packet, Scratch};
pub use parallel::Parallel;
