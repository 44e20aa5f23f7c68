//! The calls of the library's front page: a device in memory, a scanner at its addresses, and what
//! becomes of their captures.
//!
//! | file | contents |
//! | --- | --- |
//! | `builder` | what a device is built from |
//! | `calibrate` | captures of a board to a calibration |
//! | `decode` | captures to surfaces, and surfaces compared with the truth |
//! | `device` | an emulated device in memory |
//! | `scanner` | a scanner at its addresses |

mod builder;
mod calibrate;
mod decode;
mod device;
mod scanner;

pub use builder::{DeviceBuilder, ProfileSource, SceneSource};
pub use calibrate::calibrate;
pub use decode::{Decoding, compare, decode};
pub use device::Device;
pub(crate) use scanner::service_of;
pub use scanner::{ScanOptions, Scanner};
#[cfg(target_os = "linux")]
pub(crate) use scanner::{connected, truth_maps};
