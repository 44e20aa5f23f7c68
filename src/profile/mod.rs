//! `device-profiles/*.toml` and scene files as typed, validated structs.

mod builtin;
mod check;
mod device;
mod scene;
mod source;
mod usb;

pub use builtin::{profile_names, scene_names};
pub use device::{Camera, Identity, Profile, Projector, Sensor, Sequence};
pub use scene::{Ambient, Object, Scene, Shape};
pub use source::TomlSource;
pub use usb::{DsrUse, RtsUse, Speed, Transfer, Usb};
