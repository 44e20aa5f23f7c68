//! `device-profiles/*.toml` and scene files as typed, validated structs.

mod builtin;
mod camera;
mod camera_response;
mod check;
mod device;
mod focus;
mod glare;
mod light;
mod object;
mod projector;
mod response;
mod scene;
mod sensor;
mod sequence;
mod source;
mod surface;
mod usb;
pub(crate) mod vignetting;

pub use builtin::{profile_names, scene_names};
pub use camera::Camera;
pub use camera_response::CameraResponse;
pub use device::{Identity, Profile};
pub use focus::Focus;
pub use glare::Glare;
pub use light::{Ambient, Flicker, Light};
pub use object::{Object, Shape};
pub use projector::Projector;
pub use response::Response;
pub use scene::{RigPlace, Scene};
pub use sensor::Sensor;
pub use sequence::Sequence;
pub use source::TomlSource;
pub use surface::Specular;
pub use usb::{DsrUse, RtsUse, Speed, Transfer, Usb};
pub use vignetting::Vignetting;
