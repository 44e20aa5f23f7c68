//! `device-profiles/*.toml` and scene files as typed, validated structs.

mod builtin;
mod camera;
mod check;
mod device;
mod light;
mod object;
mod projector;
mod scene;
mod sensor;
mod sequence;
mod source;
mod surface;
mod usb;

pub use builtin::{profile_names, scene_names};
pub use camera::Camera;
pub use device::{Identity, Profile};
pub use light::{Ambient, Flicker, Light};
pub use object::{Object, Shape};
pub use projector::Projector;
pub use scene::Scene;
pub use sensor::Sensor;
pub use sequence::Sequence;
pub use source::TomlSource;
pub use surface::Specular;
pub use usb::{DsrUse, RtsUse, Speed, Transfer, Usb};
