//! Poses, the lens model, meshes and their files, ray casting.

mod board;
#[cfg(feature = "raycast")]
mod closest;
mod cloud;
pub mod colour;
pub mod file;
mod fold;
mod lens;
mod mesh;
mod neighbours;
pub mod nominal;
mod obj;
pub mod ply;
mod pose;
#[cfg(feature = "raycast")]
pub mod raycast;
mod rig;
pub mod shapes;
mod solid;
mod stl;
mod timeline;
mod trajectory;

pub use board::{Board, MARKERS};
#[cfg(feature = "raycast")]
pub use closest::{Closest, MeshTree};
pub use cloud::Cloud;
pub use lens::Lens;
pub use mesh::Mesh;
pub use mesh::extension;
pub use neighbours::Neighbours;
pub use pose::Pose;
pub use rig::{NoiseModel, Rig, View, Violation};
pub use solid::{Solid, SolidHit};
pub use timeline::{Span, Timeline};
pub use trajectory::Trajectory;
