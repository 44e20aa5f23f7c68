//! The items that the library exports at its root: a device in memory, a scanner at its addresses,
//! and the processing of their captures.
//!
//! | file | contents |
//! | --- | --- |
//! | `builder` | what a device is built from |
//! | `calibrate` | captures of a board to a calibration |
//! | `console` | scans as a console shows them |
//! | `decode` | captures to surfaces, and surfaces compared with the truth |
//! | `device` | an emulated device in memory |
//! | `scanner` | a scanner at its addresses |
//! | `watch` | shows a camera's frames without scanning |
//! | `track` | a patient and a tumour, tracked by the pods of a room |

mod builder;
mod calibrate;
#[cfg(feature = "console")]
mod console;
mod decode;
mod device;
mod scanner;
mod track;
mod watch;

pub use builder::{DeviceBuilder, ProfileSource, SceneSource};
pub use calibrate::{calibrate, calibrate_with_stop};
#[cfg(feature = "console")]
pub use console::{Follower, Playback, RoomViews, ScanViews, operate};
pub use decode::{Decoding, compare, decode};
pub use device::Device;
#[cfg(target_os = "linux")]
pub(crate) use scanner::connected;
pub use scanner::{ScanOptions, Scanner};
#[cfg(feature = "console")]
pub(crate) use scanner::{ask_service, dialect_of};
pub(crate) use scanner::{endpoints_in, service_of, truth_maps};
pub(crate) use track::TOLERANCE_MM;
pub use track::{
    Pod, SkinPose, TrackOptions, TrackProgress, Tracked, Tracker, TumourPosition, track,
};

// Check at compile time that programs can move these types between threads.
const _: fn() = || {
    fn is_send<T: Send>() {}
    is_send::<Device>();
    is_send::<Scanner>();
    is_send::<Decoding>();
    is_send::<Pod>();
    is_send::<Tracked>();
    #[cfg(target_os = "linux")]
    is_send::<crate::Serving>();
};
pub use watch::watch_camera;
