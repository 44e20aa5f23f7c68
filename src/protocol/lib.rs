//! What both halves speak: commands, replies, device errors, and every wire format.

pub mod data_line;
pub mod dialect;
pub mod endpoints;
pub mod faults;
mod frame;
mod printable;
pub mod record;
pub mod scpi;
pub mod service;
pub mod usb;
pub mod wire;

pub use endpoints::Endpoints;
pub use frame::{Frame, PixelFormat};
pub use printable::{printable, printable_json};
