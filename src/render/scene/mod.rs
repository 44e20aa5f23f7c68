//! Surfaces of a scene for ray casting, at one instant or as each row of a frame sees them.
//!
//! | module | contents |
//! | --- | --- |
//! | `animation` | object poses and shapes over time |
//! | `closed` | whether a mesh encloses a volume |
//! | `hits` | surfaces that sixteen rays hit, and samples of light there |
//! | `instance` | moving and deforming meshes |
//! | `key_times` | instants between which geometry is interpolated |
//! | `occluders` | what may shade points from the projector |
//! | `shape` | shapes as solids or meshes |
//! | `tree` | bounding volume hierarchy in its own frame |
//! | `triangle` | triangle surfaces |
//! | `world` | surfaces at an instant |
//! | `worlds` | surfaces over an exposure |

mod animation;
mod closed;
mod hits;
mod instance;
mod key_times;
mod occluders;
mod shape;
mod tree;
mod triangle;
mod world;
mod worlds;

pub(super) use animation::Blend;
pub(super) use hits::{Hits, Shaded, Surface, Wide};
pub(super) use instance::Instance;
pub(super) use key_times::{SPACINGS_NS, Span};
pub(super) use occluders::Occluders;
pub(super) use shape::mesh;
pub(super) use tree::{Frame, Tree};
pub(super) use world::{Placed, World};
pub(super) use worlds::{Layout, Moment, TILE, Worlds};
