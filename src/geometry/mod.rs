//! Poses, the lens model, meshes and their files, ray casting.

mod cloud;
mod lens;
pub mod ply;
mod pose;
mod rig;

pub use cloud::Cloud;
pub use lens::Lens;
pub use pose::Pose;
pub use rig::{NoiseModel, Rig, View};
