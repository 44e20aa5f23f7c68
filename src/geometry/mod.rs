//! Poses, the lens model, meshes and their files, ray casting.

mod cloud;
mod lens;
mod mesh;
mod pose;
pub mod raycast;
mod rig;
mod solid;

pub use cloud::Cloud;
pub use lens::Lens;
pub use mesh::Mesh;
pub use pose::Pose;
pub use rig::{NoiseModel, Rig, View};
pub use solid::{Solid, SolidHit};
