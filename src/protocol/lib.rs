//! Protocols shared by the device side and the host side: commands, replies, device errors, and
//! every wire and file format between them. It depends on core, pattern and device-profiles only,
//! so both sides may use it; nothing here performs rendering or decoding.
//!
//! | module | contents |
//! | --- | --- |
//! | `admission` | tokens and refusals before the first frame on the frame socket |
//! | `data_line` | embedded data line above an image |
//! | `dialect` | control-port dialects, described by TOML files |
//! | `endpoints` | `device.json`: addresses of a served device |
//! | `faults` | fault schedules |
//! | `frame` | frame and pixel format |
//! | `packing` | bytes of a row of pixels |
//! | `printable` | escaping of text for terminals |
//! | `record` | recordings of a device's traffic |
//! | `scpi` | SCPI messages, parameters, blocks and errors |
//! | `service` | service channel of an emulated device |
//! | `usb` | USB requests and descriptors, UVC, CDC-ACM, USB/IP |
//! | `wire` | frames on the frame socket |

pub mod admission;
pub mod data_line;
pub mod dialect;
pub mod endpoints;
pub mod faults;
mod frame;
mod packing;
mod printable;
pub mod record;
pub mod scpi;
pub mod service;
pub mod usb;
pub mod wire;

pub use endpoints::Endpoints;
pub use frame::{Frame, PixelFormat};
pub use printable::{printable, printable_json};
