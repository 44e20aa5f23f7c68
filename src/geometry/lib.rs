//! Geometry shared by device and host: poses, the lens model, calibrated rigs, calibration boards,
//! meshes and clouds with their file formats, generated shapes and spatial search. Depends on
//! `phasmid-core` only.
//!
//! | module | contents |
//! | --- | --- |
//! | `board` | calibration boards and their ink coverage |
//! | [`board_poses`] | plans board poses that make a calibration well determined |
//! | `closest` | closest point on a mesh (feature `raycast`) |
//! | `cloud`, `mesh` | point clouds and triangle meshes |
//! | [`colour`] | file colours as reflectance |
//! | [`file`](mod@file), `mesh_file` | reading of geometry files |
//! | `lens`, `fold` | lens model, its inverse and its folds |
//! | `neighbours` | nearest neighbours among points |
//! | [`nominal`] | nominal rigs of the built-in devices, for tests |
//! | `obj`, [`ply`], `stl` | mesh and cloud file formats |
//! | `pose`, [`rotation`] | rigid poses, rotation vectors |
//! | `rig`, [`parameters`] | calibrated camera-projector rigs, their parameters and covariance |
//! | `raycast` | packet ray casting (feature `raycast`) |
//! | [`shapes`] | generated torso, couch and linac head |
//! | `solid` | analytic solids |
//! | `timeline`, `trajectory` | keyframes and rigid motion over time |
//! | `vector` | points and directions as arguments |
//!
//! The types of a calibration ([`Rig`], [`View`], [`Lens`], [`Pose`], [`Board`]) take and return
//! arrays. Meshes, clouds and the search in them hold vectors of [`glam`], which is re-exported in the
//! version in use.

mod board;
pub mod board_poses;
#[cfg(feature = "raycast")]
mod closest;
mod cloud;
pub mod colour;
pub mod file;
mod fold;
mod lens;
mod mesh;
mod mesh_file;
mod neighbours;
pub mod nominal;
mod obj;
pub mod ply;
mod pose;
#[cfg(feature = "raycast")]
pub mod raycast;
mod rig;
pub mod rotation;
pub mod shapes;
mod solid;
mod stl;
mod timeline;
mod trajectory;
mod vector;

pub use glam;

pub use board::{Board, MARKERS};
#[cfg(feature = "raycast")]
pub use closest::{Closest, MeshTree};
pub use cloud::Cloud;
pub use lens::Lens;
pub use mesh::{Mesh, Removed};
pub use mesh_file::extension;
pub use neighbours::Neighbours;
pub use pose::Pose;
pub use rig::{Covariance, NoiseModel, Rig, View, Violation, parameters};
pub use solid::{Solid, SolidHit};
pub use timeline::{Span, Timeline};
pub use trajectory::Trajectory;
pub use vector::{Vector2, Vector3};
