//! `device-profiles/*.toml` and scene files as typed, validated structs.

mod builtin;
mod calibration;
mod camera;
mod camera_response;

mod control;
mod device;
mod distortion;

mod focus;
mod glare;
#[cfg(test)]
mod hidden_pods;
mod interreflection;
mod led;
mod light;
mod motion;
mod object;
mod placing;
mod projector;
mod response;
mod scene;
mod sensor;
mod sequence;

mod station;
mod surface;
mod timing;
mod usb;
pub mod vignetting;

pub use builtin::{profile_names, scene_names, station_names};
pub use calibration::Calibration;
pub use camera::Camera;
pub use camera_response::CameraResponse;
pub use control::{Control, Parity, Places};
pub use device::{Identity, Profile};
pub use focus::Focus;
pub use glare::Glare;
pub use interreflection::Interreflection;
pub use led::{Droop, Led};
pub use light::{Ambient, Flicker, Light};
pub use motion::{Deform, Keyframe, MeshKeyframe, Motion};
pub use object::{Object, Shape};
pub use phasmid_core::source::TomlSource;
pub use phasmid_phantom::tissue::Skin;
pub use projector::Projector;
pub use response::Response;
pub use scene::{RigPlace, Scene};
pub use sensor::Sensor;
pub use sequence::Sequence;
pub use station::{Configuration, MAX_DEVICES, Station, StationDevice};
pub use surface::Specular;
pub use timing::Timing;
pub use usb::{DsrUse, RtsUse, Speed, Transfer, Usb};
pub use vignetting::Vignetting;
