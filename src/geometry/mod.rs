//! Poses, the lens model, meshes and their files, ray casting.

mod board;
mod closest;
mod cloud;
pub(crate) mod colour;
pub(crate) mod file;
mod fold;
mod lens;
mod mesh;
mod neighbours;
#[cfg(test)]
pub(crate) mod nominal;
mod obj;
pub mod ply;
mod pose;
pub mod raycast;
mod rig;
pub mod shapes;
mod solid;
mod stl;
mod timeline;
mod trajectory;

pub use board::{Board, MARKERS};
pub use closest::{Closest, MeshTree};
pub use cloud::Cloud;
pub use lens::Lens;
pub use mesh::Mesh;
pub(crate) use mesh::extension;
pub use neighbours::Neighbours;
pub use pose::Pose;
pub use rig::{NoiseModel, Rig, View, Violation};
pub use solid::{Solid, SolidHit};
pub use timeline::{Span, Timeline};
pub use trajectory::Trajectory;
