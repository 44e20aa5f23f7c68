//! USB protocol shared by device and host: requests, descriptors, the video and serial classes, and
//! USB/IP as their transport.

pub mod cdc;
pub mod descriptor;
mod setup;
pub mod usbip;
pub mod uvc;

pub use setup::{Setup, request};
