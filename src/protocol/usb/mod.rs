//! USB as device and host speak it: requests, descriptors, the video and the serial class, and USB/IP
//! that carries them all.

pub mod cdc;
pub mod descriptor;
mod setup;
pub mod usbip;
pub mod uvc;

pub use setup::{Setup, request};
