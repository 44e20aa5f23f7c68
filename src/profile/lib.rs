//! Typed, validated descriptions, loaded from TOML: device profiles (a scanner), scenes (what is in
//! front of it) and stations (a group of scanners). A device-side crate: it depends on core,
//! geometry, pattern, protocol, phantom and device-profiles, and no host-side crate may depend on
//! it.
//!
//! | module | contents |
//! | --- | --- |
//! | `builtin` | built-in profiles, stations and scenes |
//! | `calibration` | defaults of `phasmid calibrate` for a device, and its factory's calibration |
//! | `camera` | camera optics, timing and output format |
//! | `camera_response` | response curve from linear to frame digital numbers |
//! | `control` | control port: dialect and serial settings |
//! | `device` | a complete device profile |
//! | `factory_rig` | rig that a device reports |
//! | `interreflection` | indirect light between surfaces |
//! | `led` | rise time and thermal droop of the light source |
//! | `lens` | focus, veiling glare, and the check of lens distortion |
//! | `light` | lamps, ambient light and mains flicker |
//! | `motion` | keyframed motion and deformation |
//! | `object` | shapes, poses and surfaces of a scene |
//! | `placing` | changing an object's pose at run time |
//! | `projector` | projector optics and light |
//! | `response` | light over displayed level |
//! | `scene` | a complete scene |
//! | `schema` | JSON Schemas of files, with the feature `schema` |
//! | `sensor` | image sensor in EMVA 1288 parameters |
//! | `sequence` | pattern sequences |
//! | `settings` | settings on top of a profile or a scene |
//! | `station` | several devices that observe one scene |
//! | `timing` | display timing of a DLP projector |
//! | `usb` | USB enumeration |
//! | `vignetting` | light falloff towards the edge of the field |

mod builtin;
mod calibration;
mod camera;
mod camera_response;

mod control;
mod device;
mod factory_rig;

mod interreflection;
mod led;
mod lens;
mod light;
mod motion;
mod object;
mod placing;
mod projector;
mod response;
mod scene;
#[cfg(feature = "schema")]
mod schema;
mod sensor;
mod sequence;
mod settings;

mod station;
mod timing;
mod usb;
pub mod vignetting;

/// Range of `pixel_aspect` of camera and projector: no common sensor or display is outside it.
const PIXEL_ASPECT: std::ops::RangeInclusive<f64> = 0.5..=2.0;

pub use builtin::{profile_names, profile_text, scene_names, scene_text, station_names};
pub use calibration::{Calibration, FactoryCalibration};
pub use camera::Camera;
pub use camera_response::CameraResponse;
pub use control::{Control, Parity, Places};
pub use device::{Identity, Profile};
pub use interreflection::Interreflection;
pub use led::{Droop, Led};
pub use lens::{Focus, Glare};
pub use light::{Ambient, Flicker, Light};
pub use motion::{Deform, Keyframe, MeshKeyframe, Motion};
pub use object::{Object, Shape, Specular};
pub use phasmid_core::source::{Setting, TomlSource};
pub use phasmid_phantom::tissue::Skin;
pub use projector::Projector;
pub use response::Response;
pub use scene::{RigPlace, Scene};
#[cfg(feature = "schema")]
pub use schema::Document;
pub use sensor::Sensor;
pub use sequence::Sequence;
pub use settings::Settings;
pub use station::{Configuration, MAX_DEVICES, Station, StationDevice};
pub use timing::Timing;
pub use usb::{DsrUse, RtsUse, Speed, Transfer, Usb};
pub use vignetting::Vignetting;
