//! A USB device without a kernel driver: its camera and its serial port over USB/IP, addressed as
//! `usb:HOST:PORT`.
//!
//! [`Client`] imports a device and carries transfers, [`UsbDevice`] reads its descriptors and
//! configures it, and [`UsbCamera`] and [`UsbPort`] are the drivers of its two functions. It makes
//! no difference whether the device behind the server is emulated or physical.

mod address;
mod camera;
mod client;
mod connection;
mod controls;
mod device;
mod feed;
mod frames;
mod inlet;
mod negotiation;
mod opening;
mod port;
mod replies;
mod serial;
mod topology;
mod transfer;
mod video;

pub use address::UsbAddress;
pub use camera::UsbCamera;
pub use client::Client;
pub use controls::{ControlState, VideoControl};
pub use device::{Identity, UsbDevice};
pub use port::UsbPort;
pub use serial::SerialFunction;
pub use topology::{Configuration, Endpoint, Interface, TransferKind};
pub use transfer::{Completed, Transfer};
pub use video::{VideoFunction, VideoMode};
